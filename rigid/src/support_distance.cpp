// Pairs with an ellipsoid, a cylinder or a cone: the descent and the expanding polytope of the
// support functions. Each result has two bounds of the distance:
//   apart: the separation along a direction, and the length of a segment between the bodies;
//   overlapping: the translation along a direction that separates the bodies, and the distance of
//   the origin from the boundary of a polytope inside the set of differences.
// Pairs with a half-space: the lowest vertex, whose height is exact where its sign may be wrong.
#include "support_distance.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "support_pieces.hpp"
#include "tauguard/geometry/scratch.hpp"
#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {
namespace {

constexpr double resolution = 1e-10;
constexpr double sharp = 1e-13;
constexpr int most_faces = 2000;

// A pair scaled by a power of two, so that its size is about 1. Positions are relative to `origin`.
struct ScaledPair {
  PlacedShape a, b;
  Vec3 origin;
  int exponent;

  void set(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row, double radius_a,
           double radius_b) {
    place(bodies_a, row, radius_a, &a), place(bodies_b, row, radius_b, &b);
    origin = a.frame.at;
    b.frame.at = b.frame.at - origin, a.frame.at = {};
    const double size = std::max({largest(b.frame.at), span(a.shape), span(b.shape)});
    exponent = size > 0 ? std::ilogb(size) : 0;
    scale(&a), scale(&b);
  }
  double back(double x) const { return std::ldexp(x, exponent); }
  Vec3 back(const Vec3& x) const { return {back(x[0]), back(x[1]), back(x[2])}; }

 private:
  static double span(const Shape& s) {
    double most = s.radius;
    if (s.kind == Kind::hulls)
      for (const auto* axis : {&s.x, &s.y, &s.z})
        for (const double x : *axis) most = std::max(most, std::fabs(x));
    else
      for (const double x : s.size) most = std::max(most, x);
    return most;
  }
  void scale(PlacedShape* p) const {
    const auto down = [&](double& x) { x = std::ldexp(x, -exponent); };
    for (double& x : p->frame.at) down(x);
    for (double& x : p->shape.size) down(x);
    down(p->shape.radius);
    if (p->shape.kind == Kind::hulls)
      for (auto* axis : {&p->shape.x, &p->shape.y, &p->shape.z})
        for (double& x : *axis) down(x);
  }
};

// The separation of the cores along the unit vector n.
double along(const SupportShape& a, const SupportShape& b, const Vec3& n) {
  return dot(n, b.support(-1.0 * n) - a.support(n));
}

// Looks for the least depth from directions all over the sphere, where the polytope of an overlap
// ended before its nearest face was final. Returns whether d was improved.
bool search(const SupportShape& a, const SupportShape& b, double size, Distance* d) {
  constexpr int directions = 256, rounds = 40;
  std::array<std::pair<double, Vec3>, directions> tried;
  for (int k = 0; k < directions; ++k) {  // a Fibonacci lattice
    const double z = 1 - (2 * k + 1.0) / directions, turn = k * M_PI * (3 - std::sqrt(5.0)),
                 across = std::sqrt(1 - z * z);
    const Vec3 n = {across * std::cos(turn), across * std::sin(turn), z};
    tried[k] = {along(a, b, n), n};
  }
  std::partial_sort(tried.begin(), tried.begin() + 8, tried.end(),
                    [](const auto& x, const auto& y) { return x.first > y.first; });
  bool improved = false;
  for (int k = 0; k < 8; ++k) {
    auto [value, n] = tried[k];
    double step = 0.1;
    for (int round = 0; round < rounds; ++round) {
      Vec3 side{};
      side[geometry::smallest_axis(n)] = 1;
      const Vec3 e = cross(n, side), u = (1 / norm(e)) * e, v = cross(n, u);
      const Vec3 from = n;
      for (const Vec3& t : {u, -1.0 * u, v, -1.0 * v}) {
        const Vec3 m = from + step * t, unit = (1 / norm(m)) * m;
        const double x = along(a, b, unit);
        if (x > value) value = x, n = unit;
      }
      if (n == from) step *= 0.5;
    }
    Distance next = *d;
    next.lower = value, next.n = n;
    const bool exact = sharpen(a, b, size, &next);
    if (next.lower > d->lower && exact) *d = next, improved = true;
  }
  return improved;
}

SignedDistance of_pair(const SupportShape& a, const SupportShape& b) {
  // Rounding of the support points: about a dozen operations lead to each coordinate.
  const double rounding = 64 * unit_roundoff * (a.magnitude() + b.magnitude());
  const double size = a.reach() + b.reach();
  Distance d = distance_of(a, b, {}, INFINITY);
  if (!d.overlap && d.upper - d.lower > sharp * size) sharpen(a, b, size, &d);
  // Very flat cores can stop the descent early; it goes on from the best direction.
  for (int again = 0; again < 8 && !d.overlap && d.upper - d.lower > 10 * sharp * size; ++again) {
    const Vec3 guess = again % 2 ? d.on_b - d.on_a : d.n;
    Distance next = distance_of(a, b, guess, INFINITY);
    if (next.overlap) break;
    if (next.lower < d.lower) next.lower = d.lower, next.n = d.n;
    if (next.upper > d.upper) next.upper = d.upper, next.on_a = d.on_a, next.on_b = d.on_b;
    d = next;
    sharpen(a, b, size, &d);
  }
  if (!d.overlap && d.lower > rounding) {
    const Vec3 middle = 0.5 * (d.on_a + d.on_b), way = d.on_b - d.on_a;
    // lower <= n . way <= upper
    if (d.upper > 1e-5 * size) return {dot(d.n, way), d.on_a, d.on_b, d.n};
    return {d.lower, middle - (0.5 * d.lower) * d.n, middle + (0.5 * d.lower) * d.n, d.n};
  }
  penetration(a, b, &d, resolution, most_faces);
  const double inner = d.lower, outer = along(a, b, d.n);
  d.lower = outer;
  bool sharpened = inner - outer > sharp * size && sharpen(a, b, size, &d);
  if (inner - d.lower > 1e-9 * size) sharpened = search(a, b, size, &d) || sharpened;
  if (sharpened) {
    const double depth = -std::min(0.0, d.lower);
    const Vec3 middle = 0.5 * (d.on_a + d.on_b);
    return {-depth, middle + (0.5 * depth) * d.n, middle - (0.5 * depth) * d.n, d.n};
  }
  const double depth = -std::min(0.0, outer);
  return {-depth, d.on_a + (0.5 * depth) * d.n, d.on_a - (0.5 * depth) * d.n, d.n};
}

// The sign of the exact height of the lowest vertex above the plane normal . x = offset + radius.
int exact_sign(const double* plane, const Bodies& body, std::size_t row, const Dyadic& radius) {
  const Vector3<Dyadic> n = {Dyadic(plane[0]), Dyadic(plane[1]), Dyadic(plane[2])};
  const Points<Dyadic> vertices = vertices_of<Dyadic>(body, row);
  Dyadic least = dot(n, vertices[0]);
  for (const auto& v : vertices) {
    const Dyadic x = dot(n, v);
    if (x < least) least = x;
  }
  least = least - Dyadic(plane[3]);
  if (least.sign() <= 0) return least.is_zero() && radius.is_zero() ? 0 : -1;
  return (least * least - radius * radius * dot(n, n)).sign();
}

// The exact n . x - offset, rounded once: a plane far from the world's origin costs no accuracy.
double exact_height(const double* plane, const Vec3& x) {
  Dyadic h = -Dyadic(plane[3]);
  for (int k = 0; k < 3; ++k) h += Dyadic(plane[k]) * Dyadic(x[k]);
  return h.to_double();
}

// Of a half-space (a) and a body. `core`: the lowest points of the core, their mean if several
// vertices are equally low.
SignedDistance above(const Bodies& half_space, const Bodies& body, std::size_t row, double radius_a,
                     double radius_b) {
  const double* plane = half_space.row(row);
  const Vec3 raw = geometry::load(plane);
  const double length = norm(raw);
  const Vec3 n = (1 / length) * raw;
  geometry::Scratch<PlacedShape> placed;
  place(body, row, 0, &*placed);
  const Vec3 origin = placed->frame.at;
  const SupportShape shape(*placed, origin);
  Vec3 low = shape.support(-1.0 * n);
  const double level = dot(n, low);
  const double tolerance = 1e-11 * shape.reach();
  if (is_polytope(body.kind)) {  // the mean of the vertices that are equally low
    Vec3 sum{};
    double count = 0;
    for (const Vec3& v : vertices_of<double>(body, row)) {
      const Vec3 x = v - origin;
      if (dot(n, x - low) <= tolerance) sum += x, ++count;
    }
    if (count > 1) low = (1 / count) * sum, low = low + (level - dot(n, low)) * n;
  }
  const double start = exact_height(plane, origin) / length, height = start + level;
  const double scale = shape.reach() + std::fabs(start) + radius_a + radius_b;
  SignedDistance g{height, origin + low - height * n, origin + low, n};
  int sign = 0;
  const bool unsure = !(std::fabs(height - radius_a - radius_b) > 0x1p-36 * scale);
  const bool known = unsure && is_polytope(body.kind);
  if (known) sign = exact_sign(plane, body, row, Dyadic(radius_a) + Dyadic(radius_b));
  return grown(g, radius_a, radius_b, sign, known);
}

SignedDistance turned(const SignedDistance& g) {
  return {g.distance, g.point_b, g.point_a, -1.0 * g.normal};
}

}  // namespace

SignedDistance support_distance(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row,
                                double radius_a, double radius_b) {
  if (bodies_a.kind == Kind::half_spaces) return above(bodies_a, bodies_b, row, radius_a, radius_b);
  if (bodies_b.kind == Kind::half_spaces)
    return turned(above(bodies_b, bodies_a, row, radius_b, radius_a));
  geometry::Scratch<ScaledPair> pair;
  pair->set(bodies_a, bodies_b, row, radius_a, radius_b);
  const SupportShape a(pair->a, Vec3{}), b(pair->b, Vec3{});
  SignedDistance g = grown(of_pair(a, b), a.radius(), b.radius(), 0, false);
  return {pair->back(g.distance), pair->origin + pair->back(g.point_a),
          pair->origin + pair->back(g.point_b), g.normal};
}

Vec3 support_common_point(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row,
                          double radius_a, double radius_b) {
  if (bodies_a.kind == Kind::half_spaces || bodies_b.kind == Kind::half_spaces) {
    const SignedDistance g = support_distance(bodies_a, bodies_b, row, radius_a, radius_b);
    return bodies_a.kind == Kind::half_spaces ? g.point_b : g.point_a;
  }
  geometry::Scratch<ScaledPair> pair;
  pair->set(bodies_a, bodies_b, row, radius_a, radius_b);
  const SupportShape a(pair->a, Vec3{}), b(pair->b, Vec3{});
  const Distance d = distance_of(a, b, {}, INFINITY);
  const Vec3 way = d.on_b - d.on_a;
  const double length = norm(way);
  Vec3 point = 0.5 * (d.on_a + d.on_b);
  if (!d.overlap && length > 0) {
    const double from = std::max(0.0, length - b.radius()), to = std::min(length, a.radius());
    point = d.on_a + (0.5 * (from + to) / length) * way;
  }
  return pair->origin + pair->back(point);
}

}  // namespace tauguard::rigid
