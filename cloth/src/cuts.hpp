// Cubics in Bernstein form, one per lane: whether they have a root, and where to cut them into
// pieces with fewer roots.
#pragma once

#include <cmath>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using namespace geometry;  // lanes.hpp

struct Cubics {
  Double4 b[4];
};

// The lanes that certainly have no root: all coefficients have the same sign.
TAUGUARD_INLINE Mask4 one_sign(const Cubics& c, Double4 error) {
  const Double4 least = min(min(c.b[0], c.b[1]), min(c.b[2], c.b[3])),
                most = max(max(c.b[0], c.b[1]), max(c.b[2], c.b[3]));
  return (least > error) | (most < -error);
}

// The lanes that certainly have one root: the first and the last coefficient differ in sign, and
// the sequence changes its sign once, whatever the sign of an uncertain coefficient.
TAUGUARD_INLINE Mask4 one_root(const Cubics& c, Double4 error) {
  const Double4 *b = c.b, below = -error;
  const Mask4 falls = (b[0] > error) & (b[3] < below) & ((b[1] > error) | (b[2] < below)),
              rises = (b[0] < below) & (b[3] > error) & ((b[1] < below) | (b[2] > error));
  return falls | rises;
}

// Where to cut a cubic into pieces with fewer roots. If both ends have the same sign, the cut is at
// the minimum for positive ends and at the maximum for negative ones. Otherwise it is at the
// inflection point, which has at most two roots on each side.
TAUGUARD_INLINE Double4 cut_of(const Cubics& c) {
  const Double4 s = c.b[0] > 0 ? splat(1) : splat(-1), d0 = s * (c.b[1] - c.b[0]),
                d1 = s * (c.b[2] - c.b[1]), d2 = s * (c.b[3] - c.b[2]), a = d0 - 2 * d1 + d2,
                h = d1 - d0;
  Double4 root = h * h - a * d0;
  root = root > 0 ? root : splat(0);
  for (int i = 0; i < 4; ++i) root[i] = std::sqrt(root[i]);
  const Mask4 extremum = s * c.b[3] > 0, convex = h > 0;
  const Double4 over = extremum ? (convex ? -d0 : root - h) : -h,
                under = extremum & convex ? h + root : a, cut = over / under;
  return (cut > 0x1p-20) & (cut < 1 - 0x1p-20) ? cut : splat(0.5);
}

// Divides the cubics at `cut` by de Casteljau's algorithm.
TAUGUARD_INLINE void halve(const Cubics& c, Double4 cut, Cubics& left, Cubics& right) {
  const Double4 *b = c.b, d0 = b[0] + cut * (b[1] - b[0]), d1 = b[1] + cut * (b[2] - b[1]),
                d2 = b[2] + cut * (b[3] - b[2]), e0 = d0 + cut * (d1 - d0),
                e1 = d1 + cut * (d2 - d1), f = e0 + cut * (e1 - e0);
  left = {{b[0], d0, e0, f}};
  right = {{f, e1, d2, b[3]}};
}

}  // namespace tauguard::cloth
