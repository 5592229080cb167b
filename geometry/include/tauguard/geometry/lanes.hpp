// Several numbers side by side, in the compiler's vector types. One source is compiled for the
// baseline processor and, by target attributes, for wider vector units; the program chooses at run
// time. Every variant gives the same bits, because the compiler may neither fuse multiply-adds nor
// reassociate.
#pragma once

#include <cstdint>
#include <cstring>

#include "tauguard/geometry/vec3.hpp"

#if defined(__x86_64__)
#define TAUGUARD_AVX2 __attribute__((target("avx2")))
#endif

// Compiles a function for the baseline and for AVX2; the loader chooses one. The macro is empty
// under ThreadSanitizer, because the loader would choose before ThreadSanitizer is initialised.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && defined(__linux__) && \
    !defined(__SANITIZE_THREAD__)
#define TAUGUARD_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define TAUGUARD_CLONES
#endif

namespace tauguard::geometry {

// Whether this processor can run functions with TAUGUARD_AVX2.
inline bool has_avx2() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2");
#else
  return false;
#endif
}

using Double4 = double __attribute__((vector_size(32)));
using Mask4 = std::int64_t __attribute__((vector_size(32)));  // -1 where true
using Float4 = float __attribute__((vector_size(16)));
using Float8 = float __attribute__((vector_size(32)));
using Mask8 = std::int32_t __attribute__((vector_size(32)));  // -1 where true

TAUGUARD_INLINE Double4 splat(double x) { return Double4{x, x, x, x}; }
TAUGUARD_INLINE Double4 load4(const double* from) {
  Double4 x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
TAUGUARD_INLINE Float8 load8(const float* from) {
  Float8 x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
TAUGUARD_INLINE void store4(double* to, Double4 x) { std::memcpy(to, &x, sizeof x); }
TAUGUARD_INLINE Double4 abs(Double4 x) { return (Double4)((Mask4)x & INT64_MAX); }
TAUGUARD_INLINE Double4 max(Double4 x, Double4 y) { return x > y ? x : y; }
TAUGUARD_INLINE Double4 min(Double4 x, Double4 y) { return x < y ? x : y; }
TAUGUARD_INLINE Float8 abs(Float8 x) { return (Float8)((Mask8)x & INT32_MAX); }
TAUGUARD_INLINE Float8 max(Float8 x, Float8 y) { return x > y ? x : y; }
TAUGUARD_INLINE Float8 min(Float8 x, Float8 y) { return x < y ? x : y; }

// One bit for each lane.
TAUGUARD_INLINE unsigned bits(Mask4 c) {
  const Mask4 x = c & Mask4{1, 2, 4, 8};
  return unsigned(x[0] | x[1] | x[2] | x[3]);
}

// One bit for each of eight lanes. `bits8` does not overload `bits`, because Clang treats vectors
// of equal size as one type.
TAUGUARD_INLINE unsigned bits8(Mask8 c) {
  const Mask8 x = c & Mask8{1, 2, 4, 8, 16, 32, 64, 128};
  std::uint64_t word[4];
  std::memcpy(word, &x, sizeof word);
  const std::uint64_t any = (word[0] | word[1]) | (word[2] | word[3]);
  return static_cast<unsigned>(any | any >> 32) & 0xff;
}

// The number of set bits among the low 16. (The compiler's builtin would be a function call,
// because the baseline processor has no instruction for it.)
TAUGUARD_INLINE unsigned count_of(unsigned x) {
  x -= x >> 1 & 0x5555;
  x = (x & 0x3333) + (x >> 2 & 0x3333);
  return (((x + (x >> 4)) & 0x0f0f) * 0x0101) >> 8 & 0x1f;
}

using Vec3x4 = Vector3<Double4>;
TAUGUARD_INLINE Double4 largest(const Vec3x4& a) { return max(max(abs(a.x), abs(a.y)), abs(a.z)); }

}  // namespace tauguard::geometry
