// The nearest points of a point and a triangle, or of two segments, also degenerate ones.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "tauguard/geometry/vec3.hpp"

namespace tauguard::geometry {

// The power of two that brings x into [1, 2), for 2^-1000 < x < 2^1000; 1 for x = 0.
inline double unit_scale(double x) {
  if (x > 0x1p-1000 && x < 0x1p1000) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    bits = (std::uint64_t{0x7fe} << 52) - (bits & std::uint64_t{0x7ff} << 52);
    double scale;
    std::memcpy(&scale, &bits, sizeof scale);
    return scale;
  }
  return x > 0 ? std::ldexp(1.0, -std::clamp(std::ilogb(x), -1000, 1000)) : 1;
}

// The gap between points of two features, a vertex and a face or two edges. The point of one minus
// that of the other is p - u q - v r. The domain of (u, v) is the
// triangle u + v <= 1 for a vertex and a face (u and v weigh the second and third vertex of the
// face), or the unit square for two edges (u on the first, v on the second edge; r is reversed).
template <bool vf>
struct Gap {
  Vec3 p, q, r;
  double q_scale = unit_scale(largest(q)), r_scale = unit_scale(largest(r));
  Vec3 unit_q = q_scale * q, unit_r = r_scale * r, n = cross(unit_q, unit_r);
  double nn = dot(n, n);

  struct At {
    double u, v;
  };
  static double unit(double x) { return x > 0 ? std::min(x, 1.0) : 0; }  // also of a NaN
  static At in_domain(At a) {
    const double u = unit(a.u), v = unit(a.v);
    return {u, vf ? std::min(v, 1 - u) : v};
  }
  Vec3 operator()(At a) const { return p - a.u * q - a.v * r; }
  double size(At a) const { return norm((*this)(a)); }

  // Where the gap is perpendicular to q and r, if it is `from` at (0, 0). An edge or a face without
  // area has no such place.
  At perpendicular(Vec3 from) const {
    if (!(nn > 0)) return {0, 0};
    return {dot(cross(q_scale * from, unit_r), n) / nn, dot(cross(unit_q, r_scale * from), n) / nn};
  }

  // The shortest gap on the side of the domain from a to b.
  At on_side(At a, At b) const {
    const Vec3 along = (b.u - a.u) * q + (b.v - a.v) * r;
    const double scale = unit_scale(largest(along));
    const Vec3 e = scale * along;
    const double ee = dot(e, e), s = ee > 0 ? unit(dot(scale * (*this)(a), e) / ee) : 0;
    return in_domain({a.u + s * (b.u - a.u), a.v + s * (b.v - a.v)});
  }

  static constexpr int sides = vf ? 3 : 4;
  static constexpr At corner(int i) {
    return i == 0 ? At{0, 0} : i == 1 ? At{1, 0} : i == 2 && !vf ? At{1, 1} : At{0, 1};
  }
  // The shortest gap on the border of the domain.
  At on_border() const {
    At best = on_side(corner(0), corner(1));
    for (int i = 1; i < sides; ++i) {
      const At at = on_side(corner(i), corner((i + 1) % sides));
      if (size(at) < size(best)) best = at;
    }
    return best;
  }

  // A place whose gap is the shortest of the domain, or at most `enough`. Parallel edges that meet
  // have many: this is the middle of their overlap.
  //
  // With e, the sine between q and r, `perpendicular` has an error of about 8 u / e, along a
  // direction in which the gap changes by 8 u. Each repetition with the remaining gap multiplies
  // the error across that direction by 8 u / e. Where e is too small for this, the gap to a side of
  // the domain is at most e times the length of q and r.
  At shortest(double enough) const {
    At best = in_domain(perpendicular(p));
    for (int i = 0; i < 3; ++i) {
      const At step = perpendicular((*this)(best)),
               next = in_domain({best.u + step.u, best.v + step.v});
      if (size(next) < size(best)) best = next;
    }
    At low{2, 0}, high{-1, 0};
    for (int i = 0; i < sides; ++i) {
      const At at = on_side(corner(i), corner((i + 1) % sides));
      const double gap = size(at);
      if (gap < size(best) || !std::isfinite(size(best))) best = at;
      if (gap <= enough && at.u < low.u) low = at;
      if (gap <= enough && at.u > high.u) high = at;
    }
    const bool parallel = !(nn > 0x1p-60);
    return !vf && parallel && low.u <= high.u ? At{0.5 * (low.u + high.u), 0.5 * (low.v + high.v)}
                                              : best;
  }
};

// Of a point a and the triangle b, c, d.
inline Gap<true> point_triangle(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return {a - b, c - b, d - b};
}
// Of the segments a, b and c, d.
inline Gap<false> segments(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
  return {c - a, b - a, c - d};
}

}  // namespace tauguard::geometry
