#include "signed_distance.hpp"

#include <algorithm>

#include "convex_contact.hpp"
#include "depth_bound.hpp"
#include "exact_facets.hpp"
#include "exact_nearest.hpp"
#include "facet_depth.hpp"
#include "support_distance.hpp"
#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {

namespace {

// Inlined below; the functions of signed_distance.hpp call them.
TAUGUARD_INLINE double size_here(const Points<double>& a, const Points<double>& b) {
  double size = 0;
  for (const auto* points : {&a, &b})
    for (const auto& p : *points)
      for (const double x : p) size = std::max(size, std::isfinite(x) ? std::fabs(x) : HUGE_VAL);
  return size;
}

TAUGUARD_INLINE void points_here(const Bodies& bodies, std::size_t row, const Vec3& origin,
                                 Points<double>* out) {
  const double* p = bodies.row(row);
  out->resize(bodies.vertex_count(row));
  if (bodies.kind == Kind::boxes || bodies.kind == Kind::parallelepipeds) {
    const Zonotope z = zonotope_of(bodies.kind, p);
    for (int corner = 0; corner < 8; ++corner)
      for (int k = 0; k < 3; ++k) {
        double x = (z.origin[k] - origin[k]) + z.shift[k];
        for (int axis = 0; axis < 3; ++axis)
          x += (corner >> axis & 1) ? z.g[axis][k] : -z.g[axis][k];
        (*out)[corner][k] = x;
      }
    return;
  }
  for (std::size_t i = 0; i < out->size(); ++i) (*out)[i] = geometry::load(p + 3 * i) - origin;
}

}  // namespace

double size_of(const Points<double>& a, const Points<double>& b) { return size_here(a, b); }
void local_points(const Bodies& bodies, std::size_t row, const Vec3& origin, Points<double>* out) {
  points_here(bodies, row, origin, out);
}

SignedDistance apart(const Vec3& point_a, const Vec3& point_b) {
  const Vec3 between = point_b - point_a;
  const double distance = norm(between);
  return {distance, point_a, point_b, (1 / distance) * between};
}

SignedDistance together(const Points<double>& a, const Points<double>& b, const Vec3& n,
                        double depth, double size) {
  geometry::Scratch<Points<double>> moved;
  moved->clear();
  for (const Vec3& p : b) moved->push_back(p + depth * n);
  const Vec3 point = contact_point(a, *moved, n, 1e-11 * size);
  return {-depth, point, point - depth * n, n};
}

namespace {

// The vertices of a pair relative to a point of its first body, and their size.
struct LocalPair {
  Points<double> a, b;
  Vec3 origin;
  double size;
  void set(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row) {
    origin = geometry::load(bodies_a.row(row));
    points_here(bodies_a, row, origin, &a), points_here(bodies_b, row, origin, &b);
    size = size_here(a, b);
  }
};

double top(const Points<double>& points, const Vec3& n) {
  double m = -INFINITY;
  for (const auto& p : points) m = std::max(m, dot(n, p));
  return m;
}
double bottom(const Points<double>& points, const Vec3& n) { return -top(points, -1.0 * n); }

// The distance of two bodies that are close at parallel features. The segment between the nearest
// points is then so short that rounding changes its direction. The normal of the triangle of
// differences is a better direction. The foot of the perpendicular from the origin gives the
// points.
bool between_faces(const Points<double>& a, const Points<double>& b, const Nearest& ends,
                   double size, SignedDistance* out) {
  Vec3 w[3], at_a{}, at_b{};
  double all = 0;
  for (int i = 0; i < 3; ++i) w[i] = b[ends.corner[i][1]] - a[ends.corner[i][0]];
  const Vec3 c = cross(w[1] - w[0], w[2] - w[0]);
  const double length = norm(c);
  const Vec3 n = ((dot(c, w[0]) < 0 ? -1 : 1) / length) * c, foot = dot(n, w[0]) * n;
  for (int i = 0; i < 3; ++i) {
    const Vec3 part = cross(w[(i + 1) % 3] - foot, w[(i + 2) % 3] - foot);
    const double weight = dot(part, c) / (length * length);
    if (!(weight >= 0)) return false;
    all += weight;
    at_a = at_a + weight * a[ends.corner[i][0]], at_b = at_b + weight * b[ends.corner[i][1]];
  }
  // The weights must have the sum 1: points outside the bodies would make the upper bound too low.
  // In a thin triangle rounding can move the sum far from 1.
  if (!(all > 0.5)) return false;
  at_a = (1 / all) * at_a, at_b = (1 / all) * at_b;
  *out = {norm(at_b - at_a), at_a, at_b, n};
  return norm((at_b - at_a) - out->distance * n) <= 0x1p-44 * size;
}

bool certified_apart(const Points<double>& a, const Points<double>& b, double size,
                     SignedDistance* out) {
  const Nearest ends = nearest(a, b);
  *out = apart(ends.a, ends.b);
  if (!(out->distance > near * size)) return false;
  const auto certified = [&] {  // repeats the test of `near` for the points of between_faces
    return out->distance > near * size &&
           out->distance - (bottom(b, out->normal) - top(a, out->normal)) <= certain * size;
  };
  return certified() || (ends.size == 3 && between_faces(a, b, ends, size, out) && certified());
}

TAUGUARD_CLONES bool solve(FacetDepth* facets, const BodyEdges& ea, const BodyEdges& eb,
                           double slack) {
  return facets->solve(ea, eb, slack);
}

bool certified_depth(const Points<double>& a, const Points<double>& b, const Bodies& bodies_a,
                     const Bodies& bodies_b, std::size_t row, double size, double* way, Vec3* n) {
  BodyEdges ea, eb;
  if (edges_of(bodies_a, row, &ea) && edges_of(bodies_b, row, &eb)) {
    FacetDepth facets(a, b, size);
    if (solve(&facets, ea, eb, certain * size)) {
      *way = facets.way, *n = facets.normal;
      return *way > near * size;
    }
    if (facets.apart) return false;
  }
  using Polytope = ExpandingPolytope<double, PointDifferences<double>>;
  Polytope polytope(PointDifferences<double>(a, b, size));
  if (polytope.solve(2000) != Polytope::Answer::facet) return false;
  *n = (-1 / norm(polytope.nearest.normal)) * polytope.nearest.normal;
  *way = top(a, *n) - bottom(b, *n);  // an upper bound of the depth
  const double depth = least_depth(polytope);
  return depth > near * size && *way - depth <= certain * size;
}

// The largest binary exponent among the components; 0 for a zero vector.
std::int64_t exponent(const Vector3<Dyadic>& x) {
  std::int64_t e = std::numeric_limits<std::int64_t>::min();
  for (const Dyadic& c : x)
    if (!c.is_zero()) e = std::max(e, c.floor_log2());
  return e;
}
Vec3 scaled(const Vector3<Dyadic>& x, std::int64_t e) {
  return {x[0].scaled(-e).to_double(), x[1].scaled(-e).to_double(), x[2].scaled(-e).to_double()};
}
double power(double x, std::int64_t e) {
  return std::ldexp(x, static_cast<int>(std::clamp<std::int64_t>(e, -5000, 5000)));
}

struct ExactDistance {
  SignedDistance at;
  int sign;  // of the distance minus both radii
};

// The point of a that is nearest to b.
Vec3 point_of_a(const ExactNearest<Dyadic>& nearest, const Points<double>& a) {
  const std::int64_t d = nearest.denominator.floor_log2();
  const double denominator = nearest.denominator.scaled(-d).to_double();
  Vec3 point{};
  for (std::size_t k = 0; k < nearest.pairs.size(); ++k)
    point =
        point + (nearest.weights[k].scaled(-d).to_double() / denominator) * a[nearest.pairs[k][0]];
  return point;
}

ExactDistance exact_apart(const ExactNearest<Dyadic>& nearest, const Points<double>& a,
                          const Dyadic& radii) {
  const std::int64_t e = exponent(nearest.numerator), d = nearest.denominator.floor_log2();
  const Vec3 v = scaled(nearest.numerator, e), point = point_of_a(nearest, a);
  const double length = norm(v), denominator = nearest.denominator.scaled(-d).to_double();
  const Vec3 n = (1 / length) * v;
  const double distance = power(length / denominator, e - d);
  const Dyadic reach = radii * nearest.denominator;
  return {{distance, point, point + distance * n, n},
          (dot(nearest.numerator, nearest.numerator) - reach * reach).sign()};
}

// The result for bodies that just touch after b is moved by height / |facet|^2 times `facet`.
ExactDistance exact_depth(const Vector3<Dyadic>& facet, const Dyadic& height,
                          const Points<double>& a, const Points<double>& b, const Dyadic& radii,
                          double size) {
  const std::int64_t e = exponent(facet);
  const Vec3 normal = scaled(facet, e);
  const double length = norm(normal);
  const Vec3 n = (1 / length) * normal;
  if (height.is_zero()) return {together(a, b, n, 0.0, size), radii.is_zero() ? 0 : -1};
  const std::int64_t o = height.floor_log2();
  return {together(a, b, n, power(height.scaled(-o).to_double() / length, o - e), size), -1};
}

ExactDistance exact_together(const Points<Dyadic>& x, const Points<Dyadic>& y,
                             const Points<double>& a, const Points<double>& b,
                             const ExactNearest<Dyadic>& nearest, const Dyadic& radii,
                             double size) {
  using Polytope = ExpandingPolytope<Dyadic, PointDifferences<Dyadic>>;
  Polytope polytope(PointDifferences<Dyadic>(x, y));
  const auto answer = polytope.solve(1 << 30);
  Vector3<Dyadic> facet = -polytope.nearest.normal;
  if (is_zero(facet)) facet = {Dyadic(), Dyadic(), Dyadic(-1.0)};
  if (answer != Polytope::Answer::flat)
    return exact_depth(facet, polytope.nearest.offset, a, b, radii, size);
  const Vec3 normal = scaled(facet, exponent(facet)), point = point_of_a(nearest, a);
  return {{0.0, point, point, (1 / norm(normal)) * normal}, radii.is_zero() ? 0 : -1};
}

// The exact nearest points. The search starts from the vertices that doubles find.
ExactNearest<Dyadic> exact_nearest(const Points<Dyadic>& x, const Points<Dyadic>& y,
                                   const Points<double>& a, const Points<double>& b) {
  const Nearest ends = nearest(a, b);
  return {x, y, {ends.corner.begin(), ends.corner.begin() + ends.size}};
}

ExactDistance exact_distance(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row,
                             const Points<double>& a, const Points<double>& b, const Dyadic& radii,
                             double size) {
  const auto x = vertices_of<Dyadic>(bodies_a, row), y = vertices_of<Dyadic>(bodies_b, row);
  BodyEdges ea, eb;
  ExactFacets facets;
  if (in_range(size) && edges_of(bodies_a, row, &ea) && edges_of(bodies_b, row, &eb) &&
      facets.solve(ea, eb, x, y, a, b, size) == ExactFacets::Answer::together)
    return exact_depth(facets.normal, facets.height, a, b, radii, size);
  const ExactNearest<Dyadic> nearest = exact_nearest(x, y, a, b);
  if (!is_zero(nearest.numerator)) return exact_apart(nearest, a, radii);
  return exact_together(x, y, a, b, nearest, radii, size);
}

}  // namespace

SignedDistance grown(SignedDistance g, double radius_a, double radius_b, int sign, bool known) {
  g.point_a = g.point_a + radius_a * g.normal;
  g.point_b = g.point_b - radius_b * g.normal;
  g.distance -= radius_a + radius_b;
  if (known && sign == 0) g.distance = 0;
  if (known && sign > 0) g.distance = std::max(g.distance, std::numeric_limits<double>::min());
  if (known && sign < 0) g.distance = std::min(g.distance, -std::numeric_limits<double>::min());
  return g;
}

SignedDistance signed_distance(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row,
                               double radius_a, double radius_b) {
  if (!is_polytope(bodies_a.kind) || !is_polytope(bodies_b.kind))
    return support_distance(bodies_a, bodies_b, row, radius_a, radius_b);
  geometry::Scratch<LocalPair> pair;
  pair->set(bodies_a, bodies_b, row);
  const Points<double>&a = pair->a, &b = pair->b;
  const double size = pair->size, radii = radius_a + radius_b;
  SignedDistance g;
  bool known = false;
  int sign = 0;
  bool quick = false;
  if (in_range(size)) {
    quick = certified_apart(a, b, size, &g);
    double way;
    Vec3 n;
    if (!quick && certified_depth(a, b, bodies_a, bodies_b, row, size, &way, &n))
      quick = true, g = together(a, b, n, way, size);
  }
  if (!quick || (radii > 0 && std::fabs(g.distance - radii) <= near * (size + radii))) {
    const auto exact =
        exact_distance(bodies_a, bodies_b, row, a, b, Dyadic(radius_a) + Dyadic(radius_b), size);
    if (!quick) g = exact.at;
    sign = exact.sign, known = true;
  }
  g = grown(g, radius_a, radius_b, sign, known);
  g.point_a = g.point_a + pair->origin, g.point_b = g.point_b + pair->origin;
  return g;
}

bool meet(const Bodies& bodies_a, const Bodies& bodies_b, std::size_t row, double radius_a,
          double radius_b) {
  if (!is_polytope(bodies_a.kind) || !is_polytope(bodies_b.kind))
    return support_distance(bodies_a, bodies_b, row, radius_a, radius_b).distance <= 0;
  geometry::Scratch<LocalPair> pair;
  pair->set(bodies_a, bodies_b, row);
  const Points<double>&a = pair->a, &b = pair->b;
  const double size = pair->size, radii = radius_a + radius_b;
  if (in_range(size)) {
    const Nearest ends = nearest(a, b);
    const Vec3 way = ends.b - ends.a;
    const double slack = near * (size + radii), length = norm(way);
    if (length < radii - slack) return true;
    if (length > radii + slack) {
      const Vec3 n = (1 / length) * way;
      if (bottom(b, n) - top(a, n) > radii + slack) return false;
    }
    double depth;
    Vec3 n;
    if (!(length > slack) && certified_depth(a, b, bodies_a, bodies_b, row, size, &depth, &n))
      return true;
  }
  const auto x = vertices_of<Dyadic>(bodies_a, row), y = vertices_of<Dyadic>(bodies_b, row);
  const ExactNearest<Dyadic> exact = exact_nearest(x, y, a, b);
  const Dyadic reach = (Dyadic(radius_a) + Dyadic(radius_b)) * exact.denominator;
  return (dot(exact.numerator, exact.numerator) - reach * reach).sign() <= 0;
}

}  // namespace tauguard::rigid
