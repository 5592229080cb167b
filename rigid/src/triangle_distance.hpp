// The nearest points of two triangles that share no point.
#pragma once

#include "mesh_triangles.hpp"
#include "tauguard/geometry/feature_gap.hpp"

namespace tauguard::rigid {

using geometry::Vec3;

struct NearestPair {
  double square = INFINITY;  // of the distance
  Vec3 a, b;
  void take(const Vec3& p, const Vec3& q) {
    const Vec3 gap = q - p;
    const double s = dot(gap, gap);
    if (s < square) square = s, a = p, b = q;
  }
};

// The nearest points of the segments p + s u and q + t v (Ericson 2005, 5.1.9). If the sine between
// them is below 2^-10, rounding of s could change the distance by more than 2^-40 of the lengths.
inline void take_segments(const Vec3& p, const Vec3& u, const Vec3& q, const Vec3& v,
                          NearestPair& best) {
  const Vec3 r = p - q;
  const double a = dot(u, u), e = dot(v, v), b = dot(u, v), c = dot(u, r), f = dot(v, r),
               det = a * e - b * b;
  const auto unit = [](double x) { return x > 0 ? std::min(x, 1.0) : 0.0; };
  if (!(det > 0x1p-20 * a * e)) {
    const geometry::Gap<false> gap{q - p, u, -v};
    const auto at = gap.shortest(0);
    return best.take(p + at.u * u, q + at.v * v);
  }
  double s = unit((b * f - c * e) / det), t = (b * s + f) / e;
  if (!(t >= 0 && t <= 1)) t = unit(t), s = unit((b * t - c) / a);
  best.take(p + s * u, q + t * v);
}

// A triangle and its plane. Where the sine between two sides is below 2^-8, the foot of a point on
// the plane is not accurate, and the repeated steps of the gap take its place.
struct Plane {
  Plane(const Vec3& a, const Vec3& b, const Vec3& c)
      : origin(a), q(b - a), r(c - a), n(cross(q, r)), nn(dot(n, n)) {
    thin = !(nn > 0x1p-16 * dot(q, q) * dot(r, r));
  }
  // The point of the triangle nearest to p; false if it is on an edge of a triangle that is not
  // thin.
  bool nearest(const Vec3& p, Vec3* out) const {
    double u, v;
    if (thin) {
      const auto at = geometry::Gap<true>{p - origin, q, r}.shortest(0);
      u = at.u, v = at.v;
    } else {
      const Vec3 d = p - origin;
      u = dot(cross(d, r), n), v = dot(cross(q, d), n);
      if (!(u >= 0 && v >= 0 && u + v <= nn)) return false;
      u /= nn, v /= nn;
    }
    *out = origin + u * q + v * r;
    return true;
  }
  Vec3 origin, q, r, n;
  double nn;
  bool thin;
};

// Improves `best`, if the triangles are nearer.
inline void take_triangles(const Vec3* a, const Vec3* b, NearestPair& best) {
  Vec3 ea[3], eb[3];
  for (int i = 0; i < 3; ++i) ea[i] = a[(i + 1) % 3] - a[i], eb[i] = b[(i + 1) % 3] - b[i];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) take_segments(a[i], ea[i], b[j], eb[j], best);
  const Plane of_a(a[0], a[1], a[2]), of_b(b[0], b[1], b[2]);
  Vec3 foot;
  for (int i = 0; i < 3; ++i) {
    if (of_b.nearest(a[i], &foot)) best.take(a[i], foot);
    if (of_a.nearest(b[i], &foot)) best.take(foot, b[i]);
  }
}

}  // namespace tauguard::rigid
