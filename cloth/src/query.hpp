// The differences of positions of a query (a vertex and a face, or two edges), and its coplanarity
// cubic. Every method starts from them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "ends.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::cloth {

using geometry::largest;
using geometry::unit_roundoff;
using geometry::Vec3;

// Differences of positions at both ends of the step. The cubic is p . (q x r). A direction
// separates the features if the projections of all differences in `gap` on it have the same sign.
// `big` is the largest magnitude of a component of a difference.
struct Query {
  Vec3 p[2], q[2], r[2];
  Vec3 gap[2][4];
  int gaps;
  double big, distance;
  // Bound on the error of a Bernstein coefficient, with M = big^3:
  // * A coefficient is the sum of up to three triple products. Each has 6 terms and is at most 6 M.
  // * A triple product rounds in 3 differences, 2 products and 3 sums: an error of 8 u times 6 M.
  //   For three of them this is 144 u M, and their sum adds 40 u M.
  // * A cut has 3 interpolations with 3 roundings of values up to 6 M: 54 u M. There are at most 70
  //   cuts in a row.
  // The total is (184 + 70 * 54) u M < 2^12 u M. make() prevents underflow by scaling.
  double cubic_error() const { return 0x1p-41 * big * big * big; }
};

template <bool vf>
Query make(const Ends& x, const std::int32_t* row, double distance) {
  Query k;
  k.distance = distance;
  k.gaps = vf ? 3 : 4;
  k.big = 0;
  for (int e = 0; e < 2; ++e) {
    const Vec3 a = x(e, row[0]), b = x(e, row[1]), c = x(e, row[2]), d = x(e, row[3]);
    if (vf) {
      k.p[e] = a - b;
      k.q[e] = c - b;
      k.r[e] = d - b;
      k.gap[e][0] = a - b;
      k.gap[e][1] = a - c;
      k.gap[e][2] = a - d;
    } else {
      k.p[e] = c - a;
      k.q[e] = b - a;
      k.r[e] = d - c;
      k.gap[e][0] = c - a;
      k.gap[e][1] = d - a;
      k.gap[e][2] = c - b;
      k.gap[e][3] = d - b;
    }
    for (int i = 0; i < k.gaps; ++i) k.big = std::max(k.big, largest(k.gap[e][i]));
    k.big = std::max({k.big, largest(k.q[e]), largest(k.r[e])});
  }
  // Scales the query by a power of two to `big` of about 1, so that no product overflows or
  // underflows.
  if (k.big > 0x1p-20 && k.big < 0x1p20) return k;
  const double s = k.big > 0 ? std::ldexp(1.0, -std::clamp(std::ilogb(k.big), -1000, 1000)) : 1;
  for (int e = 0; e < 2; ++e) {
    k.p[e] = s * k.p[e];
    k.q[e] = s * k.q[e];
    k.r[e] = s * k.r[e];
    for (int i = 0; i < k.gaps; ++i) k.gap[e][i] = s * k.gap[e][i];
  }
  k.big *= s;
  k.distance *= s;
  return k;
}

struct Cubic {
  double b[4];
};
inline Cubic cubic(const Query& k) {
  const Vec3 c00 = cross(k.q[0], k.r[0]), c11 = cross(k.q[1], k.r[1]);
  const Vec3 mixed = cross(k.q[0], k.r[1]) + cross(k.q[1], k.r[0]);
  return {{dot(k.p[0], c00), (dot(k.p[1], c00) + dot(k.p[0], mixed)) / 3,
           (dot(k.p[0], c11) + dot(k.p[1], mixed)) / 3, dot(k.p[1], c11)}};
}
inline int one_sign(const Cubic& c, double error) {
  if (c.b[0] > error && c.b[1] > error && c.b[2] > error && c.b[3] > error) return 1;
  if (c.b[0] < -error && c.b[1] < -error && c.b[2] < -error && c.b[3] < -error) return -1;
  return 0;
}
// Splits the cubic at s by de Casteljau's algorithm.
inline void halve(const Cubic& c, double s, Cubic& left, Cubic& right) {
  const auto l = [s](double a, double b) { return a + s * (b - a); };
  const double d0 = l(c.b[0], c.b[1]), d1 = l(c.b[1], c.b[2]), d2 = l(c.b[2], c.b[3]);
  const double e0 = l(d0, d1), e1 = l(d1, d2), f = l(e0, e1);
  left = {{c.b[0], d0, e0, f}};
  right = {{f, e1, d2, c.b[3]}};
}

// A root in (0, 1) of a cubic whose ends have different signs, by Newton's method in a bracket.
inline double root(const double* b) {
  double lo = 0, hi = 1, x = b[0] / (b[0] - b[3]);
  for (int i = 0; i < 40; ++i) {
    const double y = 1 - x;
    const double f = y * y * (b[0] * y + 3 * b[1] * x) + x * x * (3 * b[2] * y + b[3] * x);
    ((f > 0) == (b[0] > 0) ? lo : hi) = x;
    const double df =
        3 * ((b[1] - b[0]) * y * y + 2 * (b[2] - b[1]) * y * x + (b[3] - b[2]) * x * x);
    double next = x - f / df;
    if (!(next > lo && next < hi)) next = 0.5 * (lo + hi);
    if (std::fabs(next - x) < 1e-14) return next;
    x = next;
  }
  return x;
}

}  // namespace tauguard::cloth
