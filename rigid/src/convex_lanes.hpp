// What the kernels of convex bodies need of vector types beside geometry/lanes.hpp.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {

// Vector types have no namespace to be found by.
using namespace geometry;
using geometry::abs;
using geometry::max;
using geometry::min;

// False only in tests and studies that compare the vector path with the portable one.
inline std::atomic<bool> vectors_allowed{true};
inline bool use_avx2() { return vectors_allowed && has_avx2(); }

#if defined(__x86_64__)
// By halves: every x86-64 has an instruction that reads the sign bits of two lanes.
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
// It has another name because Clang takes vectors of one size for the same type.
TAUGUARD_INLINE bool all_eight(Mask8 m) { return all((Mask4)m & ((Mask4)m << 32)); }
TAUGUARD_INLINE double largest(Double4 x) {
  return std::max(std::max(x[0], x[1]), std::max(x[2], x[3]));
}
// Lane k of the result is lane k + 1, k + 2 (of four), or the next of the first three.
TAUGUARD_INLINE Double4 turn1(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 3, 0); }
TAUGUARD_INLINE Double4 turn2(Double4 x) { return __builtin_shufflevector(x, x, 2, 3, 0, 1); }
TAUGUARD_INLINE Double4 next3(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); }

}  // namespace tauguard::rigid
