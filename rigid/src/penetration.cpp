#include "expanding_polytope.hpp"
#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {
namespace {

// The set of differences b - a of two shapes, by their support functions.
class ShapeDifferences {
 public:
  struct Source {
    Vec3 a, b;
  };

  ShapeDifferences(const SupportShape& a, const SupportShape& b, double resolution)
      : a_(a), b_(b), size_(a.reach() + b.reach()), resolution_(resolution) {}

  Vec3 at(const Source& s) const { return s.b - s.a; }
  Source farthest(const Vec3& n) const { return {a_.support(-1.0 * n), b_.support(n)}; }

  bool span(std::array<Vec3, 4>* y, std::array<Source, 4>* from, Vec3* normal, bool*) const {
    return span_by_supports(*this, 1e-9 * size_, y, from, normal);
  }

  bool is_final(double excess, double square, const Source&) const {
    return excess <= resolution_ * size_ * std::sqrt(square);
  }
  bool sees(double excess, double square) const {
    return excess > 0 && excess * excess > 1e-28 * size_ * size_ * square;
  }
  // Nothing is certified for support shapes, so wrong signs are accepted.
  bool unsure(double, const Vec3&, double, const std::array<const Vec3*, 3>&) const {
    return false;
  }

 private:
  const SupportShape &a_, &b_;
  double size_, resolution_;
};

using Polytope = ExpandingPolytope<double, ShapeDifferences>;

// A point in the plane of a face, by barycentric weights; `least` is the smallest weight.
struct Barycentric {
  std::array<int, 3> corner;
  double weight[3], least;
  // Moves the point into the face if it is outside.
  void clamp() {
    weight[1] = std::clamp(weight[1], 0.0, 1.0);
    weight[2] = std::clamp(weight[2], 0.0, 1.0 - weight[1]);
    weight[0] = 1 - weight[1] - weight[2];
  }
};

Barycentric weights(const Polytope& polytope, const Polytope::Face& face, const Vec3& x) {
  const Vec3 &p = polytope.point(face.corner[0]), e = polytope.point(face.corner[1]) - p,
             g = polytope.point(face.corner[2]) - p;
  const Vec3 n = cross(e, g), o = x - p;
  const double nn = dot(n, n), s = nn > 0 ? dot(cross(o, g), n) / nn : 0,
               t = nn > 0 ? dot(cross(e, o), n) / nn : 0;
  return {face.corner, {1 - s - t, s, t}, std::min({1 - s - t, s, t})};
}

}  // namespace

void penetration(const SupportShape& a, const SupportShape& b, Distance* d, double resolution,
                 int most_faces) {
  Polytope polytope(ShapeDifferences(a, b, resolution));
  const bool flat = polytope.solve(most_faces) == Polytope::Answer::flat;
  const Vec3& normal = polytope.nearest.normal;
  const double length = norm(normal);
  if (flat) {
    d->n = length > 0 ? (1 / length) * normal : Vec3{0, 0, 1};
    if (dot(d->n, b.middle() - a.middle()) < 0) d->n = -1.0 * d->n;
    d->lower = 0;
    return;
  }
  // Moving b - a against the outward normal by the face's distance brings the origin to the
  // boundary.
  d->n = (-1 / length) * normal;
  d->lower = -std::max(0.0, polytope.nearest.offset / length);
  const Vec3 foot = d->lower * d->n;
  Barycentric best = weights(polytope, polytope.nearest, foot);
  // Triangles in one plane are equally near. The one with the foot of the perpendicular from the
  // origin gives the points.
  for (const auto& face : polytope.faces()) {
    if (best.least >= 0) break;
    if (!(dot(face.normal, normal) > (1 - 1e-12) * length * norm(face.normal))) continue;
    const Barycentric other = weights(polytope, face, foot);
    if (other.least > best.least) best = other;
  }
  best.clamp();
  Vec3 on_a{}, on_b{};
  for (int k = 0; k < 3; ++k) {
    const auto& source = polytope.source(best.corner[k]);
    on_a = on_a + best.weight[k] * source.a, on_b = on_b + best.weight[k] * source.b;
  }
  d->on_a = d->on_b = 0.5 * (on_a + on_b);
}

}  // namespace tauguard::rigid
