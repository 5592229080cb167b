// Four doubles side by side, by the compiler's vector types: the same source is compiled for the
// baseline and, by target attributes, for wider units. No contraction, no reassociation: the same
// bits from each.
#pragma once

#include <cstdint>
#include <cstring>

// Kernels must be inlined into the function that carries the target attribute.
#define TAUGUARD_INLINE inline __attribute__((always_inline))

namespace tauguard::cloth {

inline constexpr int width = 4;
using Wide = double __attribute__((vector_size(32)));
using Choice = std::int64_t __attribute__((vector_size(32)));  // -1 where true

TAUGUARD_INLINE Wide splat(double x) { return Wide{x, x, x, x}; }
TAUGUARD_INLINE Wide load(const double* from) {
  Wide x;
  std::memcpy(&x, from, sizeof x);
  return x;
}
TAUGUARD_INLINE void store(double* to, Wide x) { std::memcpy(to, &x, sizeof x); }
TAUGUARD_INLINE Wide abs(Wide x) { return (Wide)((Choice)x & INT64_MAX); }
TAUGUARD_INLINE Wide max(Wide x, Wide y) { return x > y ? x : y; }
TAUGUARD_INLINE Wide min(Wide x, Wide y) { return x < y ? x : y; }
TAUGUARD_INLINE unsigned bits(Choice c) {
  const Choice x = c & Choice{1, 2, 4, 8};
  return unsigned(x[0] | x[1] | x[2] | x[3]);
}

// How many bits of a mask of 16 (the builtin is a call where the processor's own instruction may be
// missing).
TAUGUARD_INLINE unsigned count_of(unsigned x) {
  x -= x >> 1 & 0x5555;
  x = (x & 0x3333) + (x >> 2 & 0x3333);
  return (((x + (x >> 4)) & 0x0f0f) * 0x0101) >> 8 & 0x1f;
}

struct Wide3 {
  Wide x, y, z;
};
TAUGUARD_INLINE Wide3 operator+(Wide3 a, Wide3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
TAUGUARD_INLINE Wide3 operator-(Wide3 a, Wide3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
TAUGUARD_INLINE Wide3 operator*(Wide s, Wide3 a) { return {s * a.x, s * a.y, s * a.z}; }
TAUGUARD_INLINE Wide dot(Wide3 a, Wide3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
TAUGUARD_INLINE Wide3 cross(Wide3 a, Wide3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
TAUGUARD_INLINE Wide size(Wide3 a) { return max(max(abs(a.x), abs(a.y)), abs(a.z)); }

}  // namespace tauguard::cloth
