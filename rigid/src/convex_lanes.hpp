// Operations on vector types for the kernels of convex bodies, in addition to geometry/lanes.hpp.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

// Vector types belong to no namespace, so argument-dependent lookup does not find their functions.
using namespace geometry;
using geometry::abs;
using geometry::max;
using geometry::min;

// False only in tests and studies that compare the vector path with the portable one.
inline std::atomic<bool> vectors_allowed{true};
inline bool use_avx2() { return vectors_allowed && has_avx2(); }

#if defined(__x86_64__)
// Every x86-64 processor can read the sign bits of two lanes, so the four are handled in halves.
typedef double Double2 __attribute__((vector_size(16)));
TAUGUARD_INLINE bool any(Mask4 m) {
  const auto half = __builtin_shufflevector(m, m, 0, 1) | __builtin_shufflevector(m, m, 2, 3);
  return __builtin_ia32_movmskpd((Double2)half) != 0;
}
TAUGUARD_INLINE bool all(Mask4 m) {
  const auto half = __builtin_shufflevector(m, m, 0, 1) & __builtin_shufflevector(m, m, 2, 3);
  return __builtin_ia32_movmskpd((Double2)half) == 3;
}
#else
TAUGUARD_INLINE bool any(Mask4 m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }
TAUGUARD_INLINE bool all(Mask4 m) { return (m[0] & m[1] & m[2] & m[3]) == -1; }
#endif
TAUGUARD_INLINE Double4 sqrt(Double4 x) {
#if defined(__x86_64__)
  const Double2 low = __builtin_ia32_sqrtpd(__builtin_shufflevector(x, x, 0, 1)),
                high = __builtin_ia32_sqrtpd(__builtin_shufflevector(x, x, 2, 3));
  return __builtin_shufflevector(low, high, 0, 1, 2, 3);
#else
  return {std::sqrt(x[0]), std::sqrt(x[1]), std::sqrt(x[2]), std::sqrt(x[3])};
#endif
}
// `all_eight` does not overload `all`, because Clang treats vectors of equal size as one type.
TAUGUARD_INLINE bool all_eight(Mask8 m) { return all((Mask4)m & ((Mask4)m << 32)); }
TAUGUARD_INLINE double largest(Double4 x) {
  return std::max(std::max(x[0], x[1]), std::max(x[2], x[3]));
}
// Rows first, ..., first + 3 of `count` vectors side by side; a row beyond the last repeats it.
TAUGUARD_INLINE Vec3x4 lanes_of(const Vec3* rows, std::size_t count, std::size_t first) {
  const auto at = [&](std::size_t i) { return rows[std::min(first + i, count - 1)]; };
  const Vec3 p = at(0), q = at(1), r = at(2), s = at(3);
  return {Double4{p.x, q.x, r.x, s.x}, Double4{p.y, q.y, r.y, s.y}, Double4{p.z, q.z, r.z, s.z}};
}
TAUGUARD_INLINE Vec3 lane_of(const Vec3x4& v, int lane) {
  return {v.x[lane], v.y[lane], v.z[lane]};
}

// The least and the greatest projection of points on four vectors.
struct Range4 {
  Double4 low, high;
};
template <class Points>
TAUGUARD_INLINE Range4 range(const Points& points, const Vec3x4& n) {
  Range4 r{splat(INFINITY), splat(-INFINITY)};
  for (const Vec3& p : points) {
    const Double4 x = dot(n, Vec3x4{splat(p.x), splat(p.y), splat(p.z)});
    r.low = min(x, r.low), r.high = max(x, r.high);
  }
  return r;
}

// Cyclic shifts. Lane k of the result is lane k + 1 (turn1) or k + 2 (turn2) of four lanes; next3
// shifts the first three lanes by one.
TAUGUARD_INLINE Double4 turn1(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 3, 0); }
TAUGUARD_INLINE Double4 turn2(Double4 x) { return __builtin_shufflevector(x, x, 2, 3, 0, 1); }
TAUGUARD_INLINE Double4 next3(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); }

}  // namespace tauguard::rigid
