#include "overlap.hpp"

#include <cstring>
#include <initializer_list>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace tauguard::cloth {
namespace {

// Strides of the values of a volume: for axis k, end t and side s (0 lower, 1 upper bound) the
// value is row[k * axis + t * end + s * side].
struct RowStride {
  int axis, end, side;
};
RowStride in_block(int times) { return {2 * lanes * times, 2 * lanes, lanes}; }
RowStride in_node(int slots) { return {1, 2 * slots, slots}; }

// The lanes with which a row is compared: all in use, or those after the row in the same leaf.
TAUGUARD_INLINE Mask lanes_after(bool same, int row, const LeafLanes& b) {
  return same ? b.occupied & ~Mask(0) << row << 1 : b.occupied;
}

// Rows that overlap some lane on x, y and z, and are not compared on the other axes yet.
struct Remaining {
  int rows[lanes], count = 0;
  TAUGUARD_INLINE void add(int row, Mask near, Mask shared, Overlaps& out) {
    out.adjacent += count_of(near & shared);
    out.lanes_of[row] = static_cast<std::uint16_t>(near & ~shared);
    rows[count] = row;
    count += (near & ~shared) != 0;
  }
};

TAUGUARD_INLINE Mask apart_portable(const float* row, RowStride s, const float* b, int axes,
                                    int times, Mask wanted) {
  std::int32_t apart[lanes] = {};
  for (int k = 0; k < axes; ++k, row += s.axis, b += 2 * lanes * times) {
    if (times == 1) {
      const float low = row[0], high = row[s.side];
      for (int i = 0; i < lanes; ++i) apart[i] |= -((high < b[i]) | (b[lanes + i] < low));
    } else {
      const float low0 = row[0], high0 = row[s.side], low1 = row[s.end],
                  high1 = row[s.end + s.side];
      const float* c = b + 2 * lanes;
      for (int i = 0; i < lanes; ++i)
        apart[i] |=
            -(((high0 < b[i]) & (high1 < c[i])) | ((b[lanes + i] < low0) & (c[lanes + i] < low1)));
    }
  }
  Mask mask = 0;
  for (int i = 0; i < lanes; ++i) mask |= Mask(apart[i] & 1) << i;
  return wanted & ~mask;
}

Mask node_portable(const float* node, int slots, const float* block, int axes, int times,
                   Mask wanted) {
  return apart_portable(node, in_node(slots), block, axes, times, wanted);
}
// The lanes of b that share a vertex with one lane of a.
Mask sharing_portable(const LeafLanes& a, int row, const LeafLanes& b) {
  std::int32_t equal[lanes] = {};
  for (int j = 0; j < a.arity; ++j)
    for (int k = 0; k < b.arity; ++k)
      for (int i = 0; i < lanes; ++i)
        equal[i] |= a.vertices[j * lanes + row] == b.vertices[k * lanes + i];
  Mask mask = 0;
  for (int i = 0; i < lanes; ++i) mask |= Mask(equal[i]) << i;
  return mask;
}

void pair_portable(const LeafLanes& a, const LeafLanes& b, int axes, int times, bool same,
                   Overlaps& out) {
  for (Mask rows = a.occupied; rows; rows &= rows - 1) {
    const int row = __builtin_ctz(rows);
    const Mask all = apart_portable(a.block + row, in_block(times), b.block, axes, times,
                                    lanes_after(same, row, b));
    const Mask shared = all ? all & sharing_portable(a, row, b) : 0;
    out.adjacent += count_of(shared);
    out.set(row, all & ~shared);
  }
}

#if defined(__x86_64__)
// Compares eight lanes on one axis.
template <int times>
TAUGUARD_AVX2 TAUGUARD_INLINE __m256 apart8(const float* row, RowStride s, const float* b) {
  __m256 below[times], above[times];
  for (int t = 0; t < times; ++t, row += s.end, b += 2 * lanes) {
    below[t] = _mm256_cmp_ps(_mm256_set1_ps(row[s.side]), _mm256_loadu_ps(b), _CMP_LT_OQ);
    above[t] = _mm256_cmp_ps(_mm256_loadu_ps(b + lanes), _mm256_set1_ps(row[0]), _CMP_LT_OQ);
  }
  if constexpr (times == 1) return _mm256_or_ps(below[0], above[0]);
  return _mm256_or_ps(_mm256_and_ps(below[0], below[times - 1]),
                      _mm256_and_ps(above[0], above[times - 1]));
}

// Compares all axes without a branch, which would often be mispredicted.
template <int times>
TAUGUARD_AVX2 TAUGUARD_INLINE Mask overlap_avx2(const float* row, RowStride s, const float* b,
                                                int axes, Mask wanted) {
  __m256 left = _mm256_setzero_ps(), right = left;
#pragma GCC unroll 7
  for (int k = 0; k < axes; ++k, row += s.axis, b += 2 * lanes * times) {
    left = _mm256_or_ps(left, apart8<times>(row, s, b));
    right = _mm256_or_ps(right, apart8<times>(row, s, b + 8));
  }
  return wanted & ~Mask(_mm256_movemask_ps(left) | _mm256_movemask_ps(right) << 8);
}

TAUGUARD_AVX2 Mask node_avx2(const float* node, int slots, const float* block, int axes, int times,
                             Mask wanted) {
  return times == 1 ? overlap_avx2<1>(node, in_node(slots), block, axes, wanted)
                    : overlap_avx2<2>(node, in_node(slots), block, axes, wanted);
}
template <int arity_a, int arity_b>
TAUGUARD_AVX2 TAUGUARD_INLINE Mask sharing_avx2(const LeafLanes& a, int row, const LeafLanes& b) {
  __m256i left = _mm256_setzero_si256(), right = left;
  for (int j = 0; j < arity_a; ++j)
    for (int k = 0; k < arity_b; ++k) {
      const auto* at = reinterpret_cast<const __m256i*>(b.vertices + k * lanes);
      const __m256i v = _mm256_set1_epi32(a.vertices[j * lanes + row]);
      left = _mm256_or_si256(left, _mm256_cmpeq_epi32(v, _mm256_loadu_si256(at)));
      right = _mm256_or_si256(right, _mm256_cmpeq_epi32(v, _mm256_loadu_si256(at + 1)));
    }
  return Mask(_mm256_movemask_ps(_mm256_castsi256_ps(left))) |
         Mask(_mm256_movemask_ps(_mm256_castsi256_ps(right))) << 8;
}
template <int times, int arity_a, int arity_b>
TAUGUARD_AVX2 TAUGUARD_INLINE void pair_avx2(const LeafLanes& a, const LeafLanes& b, int axes,
                                             bool same, Overlaps& out) {
  for (Mask rows = a.occupied; rows; rows &= rows - 1) {
    const int row = __builtin_ctz(rows);
    const Mask near = overlap_avx2<times>(a.block + row, in_block(times), b.block, axes,
                                          lanes_after(same, row, b));
    const Mask shared = near & sharing_avx2<arity_a, arity_b>(a, row, b);
    out.adjacent += __builtin_popcount(shared);
    out.set(row, near & ~shared);
  }
}
template <int times>
TAUGUARD_AVX2 TAUGUARD_INLINE void pair_avx2(const LeafLanes& a, const LeafLanes& b, int axes,
                                             bool same, Overlaps& out) {
  a.arity == 1 ? pair_avx2<times, 1, 3>(a, b, axes, same, out)
               : pair_avx2<times, 2, 2>(a, b, axes, same, out);
}
TAUGUARD_AVX2 void pair_avx2(const LeafLanes& a, const LeafLanes& b, int axes, int times, bool same,
                             Overlaps& out) {
  constexpr int usual = 7;  // a loop of known length is faster
  if (times == 1) return pair_avx2<1>(a, b, axes, same, out);
  axes == usual ? pair_avx2<2>(a, b, usual, same, out) : pair_avx2<2>(a, b, axes, same, out);
}

// Compares 16 volumes on one axis.
template <int times>
struct Axis16 {
  __m512 low[times], high[times];
  TAUGUARD_AVX512 TAUGUARD_INLINE static Axis16 load(const float* b) {
    Axis16 axis;
    for (int t = 0; t < times; ++t, b += 2 * lanes) {
      axis.low[t] = _mm512_loadu_ps(b);
      axis.high[t] = _mm512_loadu_ps(b + lanes);
    }
    return axis;
  }
  TAUGUARD_AVX512 TAUGUARD_INLINE Mask apart(const float* row, RowStride s) const {
    __mmask16 below = 0xffff, above = 0xffff;
    for (int t = 0; t < times; ++t, row += s.end) {
      below = _mm512_mask_cmp_ps_mask(below, _mm512_set1_ps(row[s.side]), low[t], _CMP_LT_OQ);
      above = _mm512_mask_cmp_ps_mask(above, high[t], _mm512_set1_ps(row[0]), _CMP_LT_OQ);
    }
    return Mask(below | above);
  }
};

template <int times>
TAUGUARD_AVX512 TAUGUARD_INLINE Mask overlap_avx512(const float* row, RowStride s, const float* b,
                                                    int axes, Mask wanted) {
  for (int k = 0; k < axes; ++k, row += s.axis, b += 2 * lanes * times)
    wanted &= ~Axis16<times>::load(b).apart(row, s);
  return wanted;
}

TAUGUARD_AVX512 Mask node_avx512(const float* node, int slots, const float* block, int axes,
                                 int times, Mask wanted) {
  return times == 1 ? overlap_avx512<1>(node, in_node(slots), block, axes, wanted)
                    : overlap_avx512<2>(node, in_node(slots), block, axes, wanted);
}

template <int times, int arity_a, int arity_b>
TAUGUARD_AVX512 TAUGUARD_INLINE void pair_avx512(const LeafLanes& a, const LeafLanes& b, int axes,
                                                 bool same, Overlaps& out) {
  constexpr int step = 2 * lanes * times;
  const auto x = Axis16<times>::load(b.block), y = Axis16<times>::load(b.block + step),
             z = Axis16<times>::load(b.block + 2 * step);
  __m512i vertices[arity_b];
  for (int k = 0; k < arity_b; ++k) vertices[k] = _mm512_loadu_si512(b.vertices + k * lanes);
  const RowStride s = in_block(times);
  Remaining rest;
  for (Mask rows = a.occupied; rows; rows &= rows - 1) {
    const int row = __builtin_ctz(rows);
    const float* at = a.block + row;
    const Mask near = lanes_after(same, row, b) &
                      ~(x.apart(at, s) | y.apart(at + s.axis, s) | z.apart(at + 2 * s.axis, s));
    Mask shared = 0;
    for (int j = 0; j < arity_a; ++j)
      for (int k = 0; k < arity_b; ++k)
        shared |=
            _mm512_cmpeq_epi32_mask(vertices[k], _mm512_set1_epi32(a.vertices[j * lanes + row]));
    rest.add(row, near, shared, out);
  }
  for (int i = 0; i < rest.count; ++i) {
    const int row = rest.rows[i];
    out.set(row, overlap_avx512<times>(a.block + row + 3 * s.axis, s, b.block + 3 * step, axes - 3,
                                       out.lanes_of[row]));
  }
}
TAUGUARD_AVX512 void pair_avx512(const LeafLanes& a, const LeafLanes& b, int axes, int times,
                                 bool same, Overlaps& out) {
  if (a.arity == 1) {
    times == 1 ? pair_avx512<1, 1, 3>(a, b, axes, same, out)
               : pair_avx512<2, 1, 3>(a, b, axes, same, out);
  } else {
    times == 1 ? pair_avx512<1, 2, 2>(a, b, axes, same, out)
               : pair_avx512<2, 2, 2>(a, b, axes, same, out);
  }
}
constexpr OverlapKernels avx2{node_avx2, pair_avx2}, avx512{node_avx512, pair_avx512};
#endif
constexpr OverlapKernels portable{node_portable, pair_portable};

}  // namespace

const OverlapKernels* overlap_kernels(const char* name) {
  if (std::strcmp(name, "portable") == 0) return &portable;
#if defined(__x86_64__)
  if (std::strcmp(name, "avx2") == 0 && geometry::has_avx2()) return &avx2;
  if (std::strcmp(name, "avx512") == 0 && geometry::has_avx512()) return &avx512;
#endif
  return nullptr;
}

const OverlapKernels& overlap_kernels() {
  static const OverlapKernels* best = [] {
    for (const char* name : {"avx512", "avx2"})
      if (const auto* found = overlap_kernels(name)) return found;
    return &portable;
  }();
  return *best;
}

}  // namespace tauguard::cloth
