// Four doubles or eight floats side by side, by the compiler's vector types: the same source is
// compiled for the baseline and (by target attributes) for AVX2. No contraction, no reassociation:
// the same bits.
#pragma once

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>

// Kernels must be inlined into the function that carries the target attribute.
#define TAUGUARD_INLINE inline __attribute__((always_inline))
#if defined(__x86_64__)
#define TAUGUARD_AVX2 __attribute__((target("avx2")))
#endif

namespace tauguard::rigid {

// Off only where a test or a study compares the vector path with the portable one.
inline std::atomic<bool> vectors_allowed{true};

inline bool use_avx2() {
#if defined(TAUGUARD_AVX2)
  return vectors_allowed && __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

using Double4 = double __attribute__((vector_size(32)));
using Mask4 = std::int64_t __attribute__((vector_size(32)));
using Float8 = float __attribute__((vector_size(32)));
using Mask8 = std::int32_t __attribute__((vector_size(32)));

TAUGUARD_INLINE Double4 splat(double x) { return Double4{x, x, x, x}; }
TAUGUARD_INLINE Double4 abs(Double4 x) { return (Double4)((Mask4)x & INT64_MAX); }
TAUGUARD_INLINE Float8 abs(Float8 x) { return (Float8)((Mask8)x & INT32_MAX); }
TAUGUARD_INLINE Double4 max(Double4 x, Double4 y) { return x > y ? x : y; }
TAUGUARD_INLINE Double4 min(Double4 x, Double4 y) { return x < y ? x : y; }
TAUGUARD_INLINE Float8 max(Float8 x, Float8 y) { return x > y ? x : y; }
#if defined(__x86_64__)
// Halves first: the sign bits of two lanes are read by an instruction that every x86-64 has.
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
// Another name: to Clang, vectors of one size are each other.
TAUGUARD_INLINE bool all_eight(Mask8 m) { return all((Mask4)m & ((Mask4)m << 32)); }
TAUGUARD_INLINE double largest(Double4 x) {
  return std::max(std::max(x[0], x[1]), std::max(x[2], x[3]));
}
// Lane k of the result is lane k + 1, k + 2 (of four), or the next of the first three.
TAUGUARD_INLINE Double4 turn1(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 3, 0); }
TAUGUARD_INLINE Double4 turn2(Double4 x) { return __builtin_shufflevector(x, x, 2, 3, 0, 1); }
TAUGUARD_INLINE Double4 next3(Double4 x) { return __builtin_shufflevector(x, x, 1, 2, 0, 3); }

}  // namespace tauguard::rigid
