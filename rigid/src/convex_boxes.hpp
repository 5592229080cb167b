// Box against box on unit axes (Gottschalk, Lin, Manocha 1996). The same code serves eight floats
// (convex_batch.cpp) and, in double precision, single pairs with parallel edges.
//
// Let r_Ai, r_Bk be the axes, h_A, h_B the half extents, d = c_B - c_A the offset of the centres,
// C_ik = r_Ai . r_Bk and t_i = r_Ai . d. Each of the 15 separating axes has a gap, which is
// negative if the axis does not separate. Error bounds, with u the unit roundoff of the lanes and w
// = |d|_1 + sum h_A + sum h_B:
//   u                          of an input (relative),
//   5 u                        of C,
//   5 u |d|                    of t,
//   24 u |d| + 24 u sum h      of the gap of an edge pair,
//   36 u |d| + 12 u sum h      of the gap of a facet of B.
// 64 u w covers the last two. The boxes have exactly the given rotations R. The formulas assume
// R^T R = I; entries that differ from I by at most `skew` change a gap by at most 16 skew w.
//
// The boxes overlap if the offset d is on the inner side of every facet of the zonotope A - B. The
// gap on the axis of nearly parallel edges has no certain sign, but this axis can be left out:
// 1. Edges count as parallel if 1 - C^2 < tau^2, where tau^2 is far above the rounding of 1 - C^2.
// 2. Tilting the shorter of the two edges by the angle between them makes them parallel and removes
//    their facet. It moves the points of the zonotope by at most tau h.
// 3. Each edge is in at most one parallel pair, so there are at most three pairs, and tilting moves
//    points by less than 2 tau min(sum h_A, sum h_B) in all.
// 4. If the gaps on all other axes are below minus this length, a ball of this radius around d is
//    in the tilted zonotope, and d is in the given zonotope.
#pragma once

#include "convex_abfme.hpp"

namespace tauguard::rigid {

TAUGUARD_INLINE double abs(double x) { return std::fabs(x); }
TAUGUARD_INLINE double max(double x, double y) { return x > y ? x : y; }

template <class V>
struct BoxLanes {
  V h[3], r[3][3];  // half extents; r[k][axis], body to world
};

template <class V>
struct BoxBounds {
  double unit, tau_squared, tau, low, high;  // pairs with w outside [low, high] are undecided
};
template <>
struct BoxBounds<Float8> {
  static constexpr float unit = 0x1p-24f, tau_squared = 0x1p-16f, tau = 0x1p-8f, low = 1e-30f,
                         high = 1e30f;
};
template <>
struct BoxBounds<double> {
  static constexpr double unit = 0x1p-53, tau_squared = 0x1p-44, tau = 0x1p-22, low = 1e-250,
                          high = 1e250;
};

// Sets masks (bool for scalars) of the lanes that are certainly apart or certainly overlap.
template <class V, class Mask, class Scalar>
TAUGUARD_INLINE void box_axes(const BoxLanes<V>& a, const BoxLanes<V>& b, const V* d, Scalar skew,
                              Mask& apart, Mask& together) {
  using Bounds = BoxBounds<V>;
  V t[3], c[3][3], ac[3][3];
  for (int i = 0; i < 3; ++i) {
    t[i] = a.r[0][i] * d[0] + a.r[1][i] * d[1] + a.r[2][i] * d[2];
    for (int k = 0; k < 3; ++k) {
      c[i][k] = a.r[0][i] * b.r[0][k] + a.r[1][i] * b.r[1][k] + a.r[2][i] * b.r[2][k];
      ac[i][k] = abs(c[i][k]);
    }
  }
  const V sum_a = a.h[0] + a.h[1] + a.h[2], sum_b = b.h[0] + b.h[1] + b.h[2];
  const V w = abs(d[0]) + abs(d[1]) + abs(d[2]) + sum_a + sum_b;
  const V error = (Scalar(64) * Bounds::unit + Scalar(16) * skew) * w;

  V worst = abs(t[0]) - a.h[0] - (b.h[0] * ac[0][0] + b.h[1] * ac[0][1] + b.h[2] * ac[0][2]);
  for (int i = 1; i < 3; ++i)
    worst = max(worst,
                abs(t[i]) - a.h[i] - (b.h[0] * ac[i][0] + b.h[1] * ac[i][1] + b.h[2] * ac[i][2]));
  for (int k = 0; k < 3; ++k)
    worst = max(worst, abs(t[0] * c[0][k] + t[1] * c[1][k] + t[2] * c[2][k]) - b.h[k] -
                           (a.h[0] * ac[0][k] + a.h[1] * ac[1][k] + a.h[2] * ac[2][k]));

  V straight = worst;  // the largest gap over the axes that decide overlap
  Mask any_parallel = worst != worst;
  for (int i = 0; i < 3; ++i) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int k = 0; k < 3; ++k) {
      const int k1 = (k + 1) % 3, k2 = (k + 2) % 3;
      const V gap = abs(t[i2] * c[i1][k] - t[i1] * c[i2][k]) -
                    (a.h[i1] * ac[i2][k] + a.h[i2] * ac[i1][k]) -
                    (b.h[k1] * ac[i][k2] + b.h[k2] * ac[i][k1]);
      const Mask parallel = Scalar(1) - c[i][k] * c[i][k] < Bounds::tau_squared;
      worst = max(worst, gap);
      straight = parallel ? straight : max(straight, gap);
      any_parallel = any_parallel | parallel;
    }
  }
  const Mask fits = (w >= Bounds::low) & (w <= Bounds::high);
  const V smaller = sum_a < sum_b ? sum_a : sum_b;
  const V tilt = any_parallel ? Scalar(2) * Bounds::tau * smaller : V{};
  apart = fits & (worst > error);
  together = fits & (straight < -(error + tilt));
}

// One pair in double precision, as packed rows (centre, half extents, rotation).
TAUGUARD_INLINE Verdict box_pair(const double* pa, const double* pb, double skew) {
  BoxLanes<double> a, b;
  double d[3];
  for (int k = 0; k < 3; ++k) {
    d[k] = pb[k] - pa[k];
    a.h[k] = pa[3 + k];
    b.h[k] = pb[3 + k];
    for (int axis = 0; axis < 3; ++axis) {
      a.r[k][axis] = pa[6 + 3 * k + axis];
      b.r[k][axis] = pb[6 + 3 * k + axis];
    }
  }
  bool apart, together;
  box_axes<double, bool, double>(a, b, d, skew, apart, together);
  return apart ? separated : together ? common : undecided;
}

// Eight boxes, coordinate by coordinate. Centres are doubles, so that pairs far from the origin
// lose no accuracy; the rest is in single precision.
struct BoxBlock {
  double center[3][8];
  float half_extents[3][8];
  float rotation[9][8];
};
static_assert(sizeof(BoxBlock) == 72 * sizeof(double));

TAUGUARD_INLINE Float8 load8(const float* p) {
  Float8 x;
  __builtin_memcpy(&x, p, sizeof x);
  return x;
}

TAUGUARD_INLINE void load_lanes(const BoxBlock& block, BoxLanes<Float8>& lanes) {
  for (int k = 0; k < 3; ++k) {
    lanes.h[k] = load8(block.half_extents[k]);
    for (int axis = 0; axis < 3; ++axis) lanes.r[k][axis] = load8(block.rotation[3 * k + axis]);
  }
}

TAUGUARD_INLINE void box_blocks(const BoxBlock& pa, const BoxBlock& pb, float skew, Mask8& apart,
                                Mask8& together) {
  using Double8 = double __attribute__((vector_size(64)));
  BoxLanes<Float8> a, b;
  load_lanes(pa, a), load_lanes(pb, b);
  Float8 d[3];
  for (int k = 0; k < 3; ++k) {
    Double8 x, y;
    __builtin_memcpy(&x, pa.center[k], sizeof x);
    __builtin_memcpy(&y, pb.center[k], sizeof y);
    d[k] = __builtin_convertvector(y - x, Float8);
  }
  box_axes<Float8, Mask8, float>(a, b, d, skew, apart, together);
}

}  // namespace tauguard::rigid
