// Four doubles side by side, by the compiler's vector types: the same source is compiled for the baseline and,
// by target attributes, for wider units. No contraction, no reassociation: the same bits from each.
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
  unsigned all = 0;
  for (int i = 0; i < width; ++i) all |= unsigned(c[i] & 1) << i;
  return all;
}

struct Wide3 { Wide x, y, z; };
TAUGUARD_INLINE Wide3 operator+(Wide3 a, Wide3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
TAUGUARD_INLINE Wide3 operator-(Wide3 a, Wide3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
TAUGUARD_INLINE Wide3 operator*(Wide s, Wide3 a) { return {s * a.x, s * a.y, s * a.z}; }
TAUGUARD_INLINE Wide dot(Wide3 a, Wide3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
TAUGUARD_INLINE Wide3 cross(Wide3 a, Wide3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
TAUGUARD_INLINE Wide size(Wide3 a) { return max(max(abs(a.x), abs(a.y)), abs(a.z)); }

}  // namespace tauguard::cloth
