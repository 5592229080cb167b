#include "tauguard/rigid/distance.hpp"

#include "hull_descent.hpp"

namespace tauguard::rigid {
namespace {

struct SourcePoints {
  Vec3 a, b;
};

// Keeps the direction of the largest separation. Close to contact, cancellation makes the nearest
// point useless as a direction, so the normals of the simplex's triangles are tried, too.
struct Separating : ToRounding {
  const PointList &a, &b;
  Vec3* n;
  double* separation;

  Separating(const PointList& a, const PointList& b, Vec3* n, double* separation)
      : a(a), b(b), n(n), separation(separation) {}
  void attempt(const Vec3& d) {
    const double length = norm(d);
    if (!(length > 0)) return;
    for (const double sign : {1.0, -1.0}) {
      const Vec3 u = (sign / length) * d;
      const double s = dot(u, b[extreme(b, -1.0 * u)]) - dot(u, a[extreme(a, u)]);
      if (s > *separation) *separation = s, *n = u;
    }
  }
  void visit(const Simplex<Rows>& s) {
    attempt(s.nearest());
    if (s.size() == 3) attempt(cross(s.w(1) - s.w(0), s.w(2) - s.w(0)));
  }
  void stuck(const Simplex<Rows>& s, const Vec3& next) {
    const int size = s.size() + 1;
    const Vec3 all[4] = {s.w(0), size > 2 ? s.w(1) : next, size > 3 ? s.w(2) : next, next};
    for (int skip = 0; size == 4 && skip < 4; ++skip)
      attempt(cross(all[(skip + 1) % 4] - all[skip], all[(skip + 2) % 4] - all[skip]));
    if (size == 3) attempt(cross(all[1] - all[0], all[2] - all[0]));
  }
};

// Keeps the best certified lower bound, and ends the descent when this bound is tight enough.
struct Bounded {
  Distance& out;
  double needed;

  void attempt(const Vec3& direction, const Vec3& w) {
    const double length = norm(direction);
    if (!(length > 0)) return;
    const double lower = dot(direction, w) / length;
    if (lower > out.lower) out.lower = lower, out.n = (1 / length) * direction;
  }
  void visit(const Simplex<SourcePoints>&) {}
  bool enough(const Vec3& v, const Vec3& next) {
    attempt(v, next);
    const double length = norm(v);
    return length - out.lower <= 1e-10 * length ||
           (out.lower > needed && length - out.lower < 0.1 * (out.lower - needed));
  }
  void stuck(const Simplex<SourcePoints>&, const Vec3&) {}
};

Distance of_half_space(const SupportShape& a, const SupportShape& b) {
  Distance d;
  d.n = a.plane_normal();
  d.on_b = b.support(-1.0 * d.n);
  d.lower = dot(d.n, d.on_b - a.middle());
  d.on_a = d.on_b - d.lower * d.n;
  d.upper = std::fabs(d.lower);
  d.overlap = d.lower < 0;
  return d;
}

}  // namespace

TAUGUARD_FLAT bool separating_direction(const PointList& a, const PointList& b, Vec3* n,
                                        double* separation) {
  *separation = -INFINITY;
  Separating watch(a, b, n, separation);
  descend_hulls(a, b, watch);
  return *separation > 0;
}

TAUGUARD_FLAT Nearest nearest(const PointList& a, const PointList& b) { return nearest_of(a, b); }

TAUGUARD_FLAT Distance distance_of(const SupportShape& a, const SupportShape& b, const Vec3& guess,
                                   double needed) {
  if (a.half_space()) return of_half_space(a, b);
  Distance out;
  const auto support = [&](const Vec3& v) {
    const Vec3 p = a.support(v), q = b.support(-1.0 * v);
    return Corner<SourcePoints>{q - p, {p, q}, 0};
  };
  Vec3 start = guess;
  if (!(dot(start, start) > 0)) start = b.middle() - a.middle();
  if (!(dot(start, start) > 0)) start = {0, 0, 1};
  Corner<SourcePoints> first = support(start);
  first.weight = 1;
  Bounded watch{out, needed};
  watch.attempt(start, first.w);
  // A nearest point closer to the origin than `rounding` counts as zero. About a dozen operations
  // lead to each coordinate; 64 u covers their errors.
  const double rounding = 64 * unit_roundoff * (a.magnitude() + b.magnitude());
  const Simplex<SourcePoints> s = descend(first, support, watch, rounding * rounding);
  const double square = dot(s.nearest(), s.nearest());
  out.overlap = s.size() == 4 || square <= rounding * rounding;
  // As in Separating: close to contact, the normal of the last triangle is the better direction.
  if (!out.overlap && s.size() == 3) {
    Vec3 n = cross(s.w(1) - s.w(0), s.w(2) - s.w(0));
    if (dot(n, s.w(0)) < 0) n = -1.0 * n;
    if (dot(n, n) > 0) watch.attempt(n, support(n).w);
  }
  out.upper = std::sqrt(square);
  for (int i = 0; i < s.size(); ++i) {
    const Corner<SourcePoints>& c = s.corner(i);
    out.on_a = out.on_a + c.weight * c.from.a, out.on_b = out.on_b + c.weight * c.from.b;
  }
  return out;
}

}  // namespace tauguard::rigid
