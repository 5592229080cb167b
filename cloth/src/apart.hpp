// The first filter of single queries. Two features cannot meet if one axis separates them on the
// same side at both ends of the step. The filter compares x, y and z, which is exact. If many
// queries share positions, it compares the seven axes of a 14-DOP in float32, with a margin for
// rounding.
#pragma once

#include <algorithm>
#include <cstdint>

#include "ends.hpp"
#include "k_dop.hpp"
#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using namespace geometry;  // lanes.hpp

inline constexpr int ahead = 8;  // prefetch distance, in queries

template <bool packed>
TAUGUARD_INLINE void prefetch(const Ends& x, const std::int32_t* row) {
  for (int v = 0; v < 4; ++v) {
    __builtin_prefetch(x.t0 + (packed ? Ends::line : x.stride) * std::ptrdiff_t(row[v]));
    if (!packed) __builtin_prefetch(x.t1 + x.stride * std::ptrdiff_t(row[v]));
  }
}

template <bool packed>
TAUGUARD_INLINE Double4 point(const Ends& x, bool end, std::int32_t v) {
  const double* p = (end ? x.t1 : x.t0) + (packed ? Ends::line : x.stride) * std::ptrdiff_t(v);
  if (packed) return load4(p);
  return Double4{p[0], p[1], p[2], p[2]};
}

// Writes the numbers of the queries that no axis separates to `left`, and returns how many there
// are. rows: (n, 4) vertices.
template <bool vf>
TAUGUARD_INLINE int not_apart(const Ends& x, const std::int32_t* rows, int n, std::int32_t* left) {
  int count = 0;
  for (int i = 0; i < n; ++i) {
    prefetch<false>(x, rows + 4 * std::min(i + ahead, n - 1));
    const std::int32_t* row = rows + 4 * i;
    Mask4 above{-1, -1, -1, -1}, below = above;
    for (int e = 0; e < 2; ++e) {
      const Double4 a = point<false>(x, e, row[0]), b = point<false>(x, e, row[1]),
                    c = point<false>(x, e, row[2]), d = point<false>(x, e, row[3]);
      above &= (vf ? a : min(a, b)) > (vf ? max(max(b, c), d) : max(c, d));
      below &= (vf ? a : max(a, b)) < (vf ? min(min(b, c), d) : min(c, d));
    }
    const Mask4 apart = above | below;
    left[count] = i;
    count += (apart[0] | apart[1] | apart[2]) == 0;
  }
  return count;
}

// The axes of the float32 filter: a vertex has 7 (padded to 8) values at each end of the step,
// which fill one cache line (64 bytes).
inline constexpr VolumeKind seven_axes{14, true};

// Whether the exact projection of x is certainly above that of y. A value differs from the exact
// one, which is at most 1, by at most 2^-24 (k_dop.hpp). If x > fl(y + gap), the exact difference
// is more than gap - 2^-24 (1 + gap) - 2 * 2^-24 > 0.
TAUGUARD_INLINE Mask8 above(Float8 x, Float8 y) {
  constexpr float gap = 0x1p-21f;
  return x > y + gap;
}

// The axes on which the first feature is above the second, and those on which it is below.
struct Sides {
  Mask8 over, under;
};
template <bool vf>
TAUGUARD_INLINE Sides sides(Float8 a, Float8 b, Float8 c, Float8 d) {
  if (vf) return {above(a, max(max(b, c), d)), above(min(min(b, c), d), a)};
  return {above(min(a, b), max(c, d)), above(min(c, d), max(a, b))};
}

// As not_apart, but compares projections onto `seven_axes`.
template <bool vf>
TAUGUARD_INLINE int not_apart_on_seven(const float* points, const std::int32_t* rows, int n,
                                       std::int32_t* left) {
  constexpr int slots = 8;
  const auto place = [points](std::int32_t v) { return points + 2 * slots * std::ptrdiff_t(v); };
  int count = 0;
  for (int i = 0; i < n; ++i) {
    const std::int32_t *row = rows + 4 * i, *next = rows + 4 * std::min(i + ahead, n - 1);
    for (int j = 0; j < 4; ++j) __builtin_prefetch(place(next[j]));
    const float *a = place(row[0]), *b = place(row[1]), *c = place(row[2]), *d = place(row[3]);
    const Sides start = sides<vf>(load8(a), load8(b), load8(c), load8(d));
    const Sides end =
        sides<vf>(load8(a + slots), load8(b + slots), load8(c + slots), load8(d + slots));
    const Mask4 apart = (Mask4)((start.over & end.over) | (start.under & end.under));
    left[count] = i;
    count += (apart[0] | apart[1] | apart[2] | apart[3]) == 0;
  }
  return count;
}

}  // namespace tauguard::cloth
