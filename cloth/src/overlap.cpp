#include "overlap.hpp"

#include <type_traits>

namespace tauguard::cloth {
namespace {

// Strides of the values of a volume: for axis k, end t and side s (0 lower, 1 upper bound) the
// value is row[k * axis + t * end + s * side].
struct RowStride {
  int axis, end, side;
};
constexpr RowStride in_block(int times) { return {2 * lanes * times, 2 * lanes, lanes}; }
constexpr RowStride in_node(int slots) { return {1, 2 * slots, slots}; }

// The lanes with which a row is compared: all in use, or those after the row in the same leaf.
template <class Bound>
TAUGUARD_INLINE Mask lanes_after(bool same, int row, const LeafLanes<Bound>& b) {
  return same ? b.occupied & ~Mask(0) << row << 1 : b.occupied;
}

template <class Bound>
TAUGUARD_INLINE Mask overlap_portable(const Bound* row, RowStride s, const Bound* b, int axes,
                                      int times, Mask wanted) {
  std::conditional_t<sizeof(Bound) == 2, std::int16_t, std::int32_t> apart[lanes] = {};
  for (int k = 0; k < axes; ++k, row += s.axis, b += 2 * lanes * times) {
    if (times == 1) {
      const Bound low = row[0], high = row[s.side];
      for (int i = 0; i < lanes; ++i) apart[i] |= -((high < b[i]) | (b[lanes + i] < low));
    } else {
      const Bound low0 = row[0], high0 = row[s.side], low1 = row[s.end],
                  high1 = row[s.end + s.side];
      const Bound* c = b + 2 * lanes;
      for (int i = 0; i < lanes; ++i)
        apart[i] |=
            -(((high0 < b[i]) & (high1 < c[i])) | ((b[lanes + i] < low0) & (c[lanes + i] < low1)));
    }
  }
  Mask mask = 0;
  for (int i = 0; i < lanes; ++i) mask |= Mask(apart[i] & 1) << i;
  return wanted & ~mask;
}

template <class Bound>
Mask node_portable(const Bound* node, int slots, const Bound* block, int times, Mask wanted) {
  return overlap_portable(node, in_node(slots), block, 3, times, wanted);
}
// The lanes of b that share a vertex with one lane of a.
template <class Bound>
Mask sharing_portable(const LeafLanes<Bound>& a, int row, const LeafLanes<Bound>& b) {
  std::int32_t equal[lanes] = {};
  for (int j = 0; j < a.arity; ++j)
    for (int k = 0; k < b.arity; ++k)
      for (int i = 0; i < lanes; ++i)
        equal[i] |= a.vertices[j * lanes + row] == b.vertices[k * lanes + i];
  Mask mask = 0;
  for (int i = 0; i < lanes; ++i) mask |= Mask(equal[i]) << i;
  return mask;
}

template <class Bound>
void pair_portable(const LeafLanes<Bound>& a, const LeafLanes<Bound>& b, int axes, int times,
                   bool same, Overlaps& out) {
  for (Mask rows = a.occupied; rows; rows &= rows - 1) {
    const int row = __builtin_ctz(rows);
    const Mask all = overlap_portable(a.block + row, in_block(times), b.block, axes, times,
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
TAUGUARD_AVX2 TAUGUARD_INLINE __m256i load(const std::int16_t* from) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
}
// As above, with all sixteen lanes in one register.
template <int times>
TAUGUARD_AVX2 TAUGUARD_INLINE Mask overlap_avx2(const std::int16_t* row, RowStride s,
                                                const std::int16_t* b, int axes, Mask wanted) {
  __m256i apart = _mm256_setzero_si256();
#pragma GCC unroll 7
  for (int k = 0; k < axes; ++k, row += s.axis) {
    __m256i below[times], above[times];
    for (int t = 0; t < times; ++t, b += 2 * lanes) {
      const std::int16_t* at = row + t * s.end;
      below[t] = _mm256_cmpgt_epi16(load(b), _mm256_set1_epi16(at[s.side]));
      above[t] = _mm256_cmpgt_epi16(_mm256_set1_epi16(at[0]), load(b + lanes));
    }
    apart = _mm256_or_si256(apart, _mm256_and_si256(below[0], below[times - 1]));
    apart = _mm256_or_si256(apart, _mm256_and_si256(above[0], above[times - 1]));
  }
  const __m128i bytes =
      _mm_packs_epi16(_mm256_castsi256_si128(apart), _mm256_extracti128_si256(apart, 1));
  return wanted & ~Mask(_mm_movemask_epi8(bytes));
}

template <class Bound>
TAUGUARD_AVX2 Mask node_avx2(const Bound* node, int slots, const Bound* block, int times,
                             Mask wanted) {
  return times == 1 ? overlap_avx2<1>(node, in_node(slots), block, 3, wanted)
                    : overlap_avx2<2>(node, in_node(slots), block, 3, wanted);
}
template <int arity_a, int arity_b, class Bound>
TAUGUARD_AVX2 TAUGUARD_INLINE Mask sharing_avx2(const LeafLanes<Bound>& a, int row,
                                                const LeafLanes<Bound>& b) {
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
template <int times, int arity_a, int arity_b, class Bound>
TAUGUARD_AVX2 TAUGUARD_INLINE void pair_avx2(const LeafLanes<Bound>& a, const LeafLanes<Bound>& b,
                                             int axes, bool same, Overlaps& out) {
  for (Mask rows = a.occupied; rows; rows &= rows - 1) {
    const int row = __builtin_ctz(rows);
    const Mask near = overlap_avx2<times>(a.block + row, in_block(times), b.block, axes,
                                          lanes_after(same, row, b));
    const Mask shared = near & sharing_avx2<arity_a, arity_b>(a, row, b);
    out.adjacent += __builtin_popcount(shared);
    out.set(row, near & ~shared);
  }
}
template <int times, class Bound>
TAUGUARD_AVX2 TAUGUARD_INLINE void pair_avx2(const LeafLanes<Bound>& a, const LeafLanes<Bound>& b,
                                             int axes, bool same, Overlaps& out) {
  a.arity == 1 ? pair_avx2<times, 1, 3>(a, b, axes, same, out)
               : pair_avx2<times, 2, 2>(a, b, axes, same, out);
}
template <class Bound>
TAUGUARD_AVX2 void pair_avx2(const LeafLanes<Bound>& a, const LeafLanes<Bound>& b, int axes,
                             int times, bool same, Overlaps& out) {
  constexpr int usual = 7;  // a loop of known length is faster
  if (times == 1) return pair_avx2<1>(a, b, axes, same, out);
  axes == usual ? pair_avx2<2>(a, b, usual, same, out) : pair_avx2<2>(a, b, axes, same, out);
}
template <class Bound>
constexpr OverlapKernels<Bound> avx2{node_avx2<Bound>, pair_avx2<Bound>};
#endif
template <class Bound>
constexpr OverlapKernels<Bound> portable{node_portable<Bound>, pair_portable<Bound>};

}  // namespace

template <class Bound>
const OverlapKernels<Bound>* overlap_kernels(const char* name) {
  if (std::strcmp(name, "portable") == 0) return &portable<Bound>;
#if defined(__x86_64__)
  if (std::strcmp(name, "avx2") == 0 && geometry::has_avx2()) return &avx2<Bound>;
#endif
  return nullptr;
}

template <class Bound>
const OverlapKernels<Bound>& overlap_kernels() {
  static const OverlapKernels<Bound>* best = [] {
    const auto* found = overlap_kernels<Bound>("avx2");
    return found ? found : overlap_kernels<Bound>("portable");
  }();
  return *best;
}

template const OverlapKernels<float>* overlap_kernels<float>(const char*);
template const OverlapKernels<std::int16_t>* overlap_kernels<std::int16_t>(const char*);
template const OverlapKernels<float>& overlap_kernels<float>();
template const OverlapKernels<std::int16_t>& overlap_kernels<std::int16_t>();

}  // namespace tauguard::cloth
