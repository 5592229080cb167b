// Point, normal and weights of a collision whose time is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ends.hpp"
#include "query.hpp"

namespace tauguard::cloth {

// Output of queries. Row i is written if query i has contact. The weights belong to the four
// vertices of the row: (1, w0, w1, w2) for a vertex and a face, or (1 - s, s, 1 - t, t) for two
// edges. All pointers except `toi` are null if only times are needed.
struct ImpactArrays {
  double *toi, *point, *normal, *weights;  // shapes (n), (n, 3), (n, 3), (n, 4)
};

// The power of two that brings x into [1, 2), for 2^-1000 < x < 2^1000; 1 for x = 0.
inline double unit_scale(double x) {
  return x > 0 ? std::ldexp(1.0, -std::clamp(std::ilogb(x), -1000, 1000)) : 1;
}

// The point of one feature minus that of the other is p - u q - v r. The domain of (u, v) is the
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

  // A place whose gap is the shortest of the domain, or at most `enough`. Parallel edges that meet
  // have many: this is the middle of their overlap.
  //
  // With e, the sine between q and r, `perpendicular` has an error of about 8 u / e, along a
  // direction in which the gap changes by 8 u. Each repetition with the remaining gap multiplies
  // the error across that direction by 8 u / e. Where e is too small for this, the gap to a side of
  // the domain is at most e times the length of q and r.
  At shortest(double enough) const {
    constexpr At corner[4] = {{0, 0}, {1, 0}, {vf ? 0.0 : 1.0, 1}, {0, 1}};
    constexpr int sides = vf ? 3 : 4;
    At best = in_domain(perpendicular(p));
    for (int i = 0; i < 3; ++i) {
      const At step = perpendicular((*this)(best)),
               next = in_domain({best.u + step.u, best.v + step.v});
      if (size(next) < size(best)) best = next;
    }
    At low{2, 0}, high{-1, 0};
    for (int i = 0; i < sides; ++i) {
      const At at = on_side(corner[i], corner[(i + 1) % sides]);
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

// Computes point, normal and weights of the contact at time t, for a minimum distance.
//
// The two points of the weights coincide except for
// * the movement within 1e-9 of the step, by which t may be early: with M, the largest component of
//   a displacement relative to that of the first vertex, at most 2e-9 sqrt 3 M < 2^-28 M, and
// * rounding, at most 2^-44 of the largest coordinate.
// The plane's solution is used where it reaches this bound, and the sine between q and r is above
// about 2^-20. Otherwise the shortest gap is searched.
template <bool vf>
void describe(const Ends& x, const std::int32_t* row, double t, double distance, ImpactArrays out,
              std::size_t i) {
  Vec3 start[4], end[4], at[4];
  double big = 0, moved = 0;
  for (int k = 0; k < 4; ++k) {
    start[k] = x(false, row[k]);
    end[k] = x(true, row[k]);
    big = std::max({big, largest(start[k]), largest(end[k])});
  }
  const double scale = big > 0x1p-200 && big < 0x1p200 ? 1 : unit_scale(big);
  for (int k = 0; k < 4; ++k) {
    start[k] = scale * start[k];
    end[k] = scale * end[k];
    at[k] = mix(start[k], end[k], t);
    moved = std::max(moved, largest(end[k] - start[k] - (end[0] - start[0])));
  }
  const auto [a, b, c, d] = at;
  const Gap<vf> gap{vf ? a - b : c - a, vf ? c - b : b - a, vf ? d - b : c - d};
  auto uv = gap.in_domain(gap.perpendicular(gap.p));
  const double enough = scale * distance + 0x1p-28 * moved + 0x1p-44 * scale * big;
  if (!(gap.nn > 0x1p-40 && gap.size(uv) <= enough)) uv = gap.shortest(enough);

  double* w = out.weights + 4 * i;
  w[0] = vf ? 1 : 1 - uv.u;
  w[1] = vf ? 1 - uv.u - uv.v : uv.u;
  w[2] = vf ? uv.u : 1 - uv.v;
  w[3] = uv.v;
  const Vec3 point = (1 / scale) * (vf ? a : a + uv.u * gap.q);
  const double length = std::sqrt(gap.nn);
  const Vec3 n = length > 0 ? ((vf ? 1 : -1) / length) * gap.n : Vec3{0, 0, 0};
  std::copy(point.begin(), point.end(), out.point + 3 * i);
  std::copy(n.begin(), n.end(), out.normal + 3 * i);
}

}  // namespace tauguard::cloth
