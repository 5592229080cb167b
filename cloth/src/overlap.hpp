// Finds which of 16 bounding volumes a volume overlaps. This is the inner loop of the broad phase.
#pragma once

#include <cstdint>
#include <cstring>

#include "tauguard/geometry/lanes.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace tauguard::cloth {

using geometry::count_of;

inline constexpr int lanes = 16;
using Mask = std::uint32_t;  // one bit per lane

// A block has 16 volumes, [axis][end of the step][low, high][lane]. A node has one volume,
// [end of the step][low, high][axis slot]. An empty lane or node is (inf, -inf) on every axis.
//
// A bound is a float, or an integer of 16 bits where that precision suffices. The conversion is
// monotone, so that volumes that overlap also overlap in 16 bits.
inline constexpr int shorts_of_unit = 32000;  // a projection is at most 1 (k_dop.hpp)
TAUGUARD_INLINE void convert(geometry::Float4 x, float* to) { std::memcpy(to, &x, sizeof x); }
TAUGUARD_INLINE void convert(geometry::Float4 x, std::int16_t* to) {
  constexpr float most = shorts_of_unit;  // also of the bounds of empty lanes
  x = most * x;
  x = x < most ? x : geometry::Float4{} + most;
#if defined(__x86_64__)
  const __m128i whole = _mm_cvttps_epi32(x);  // -2^31 for any x below -2^31
  _mm_storel_epi64(reinterpret_cast<__m128i*>(to), _mm_packs_epi32(whole, whole));
#else
  for (int i = 0; i < 4; ++i) to[i] = static_cast<std::int16_t>(x[i] > -most ? x[i] : -most);
#endif
}

// The 16 features of a leaf: volumes, vertices [vertex of the feature][lane], and the lanes in use.
template <class Bound>
struct LeafLanes {
  const Bound* block;
  const std::int32_t* vertices;
  int arity;
  Mask occupied;
};
// The overlapping features of two leaves.
struct Overlaps {
  Mask rows = 0;                  // lanes of the first leaf that overlap a lane of the second
  unsigned adjacent = 0;          // number of pairs left out because they share a vertex
  std::uint16_t lanes_of[lanes];  // for each lane in `rows`, the lanes of the second leaf

  TAUGUARD_INLINE void set(int row, Mask which) {
    lanes_of[row] = static_cast<std::uint16_t>(which);
    rows |= Mask(which != 0) << row;
  }
};

template <class Bound>
struct OverlapKernels {
  // The lanes of `block`, among `candidates`, that `node` overlaps on the first three axes.
  Mask (*lanes_of_node)(const float* node, int slots, const Bound* block, int times,
                        Mask candidates);
  // Finds pairs of features whose volumes overlap and that share no vertex. same: b is a, and each
  // unordered pair is found once. Features with a common vertex always overlap, so the order of the
  // two tests does not matter.
  void (*leaf_pair)(const LeafLanes<Bound>& a, const LeafLanes<Bound>& b, int axes, int times,
                    bool same, Overlaps& out);
};

// The fastest kernels that this processor can run. All variants give the same result.
template <class Bound>
const OverlapKernels<Bound>& overlap_kernels();
// For tests: the kernels "portable" or "avx2"; null if the processor cannot run them.
template <class Bound>
const OverlapKernels<Bound>* overlap_kernels(const char* name);

// Whether no axis separates two nodes on the same side at all ends.
template <int slots, int times>
bool nodes_overlap(const float* a, const float* b) {
  int apart = 0;
  constexpr int high = slots, end = 2 * slots;
  for (int k = 0; k < slots; ++k)
    if constexpr (times == 1) {
      apart |= (a[high + k] < b[k]) | (b[high + k] < a[k]);
    } else {
      apart |= ((a[high + k] < b[k]) & (a[end + high + k] < b[end + k])) |
               ((b[high + k] < a[k]) & (b[end + high + k] < a[end + k]));
    }
  return apart == 0;
}

using NodeTest = bool (*)(const float*, const float*);
inline NodeTest node_test(int slots, int times) {
  if (times == 1)
    return slots == 4   ? nodes_overlap<4, 1>
           : slots == 8 ? nodes_overlap<8, 1>
                        : nodes_overlap<16, 1>;
  return slots == 4 ? nodes_overlap<4, 2> : slots == 8 ? nodes_overlap<8, 2> : nodes_overlap<16, 2>;
}

}  // namespace tauguard::cloth
