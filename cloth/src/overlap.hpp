// Finds which of 16 bounding volumes a volume overlaps. This is the inner loop of the broad phase.
#pragma once

#include <cstdint>

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using geometry::count_of;

inline constexpr int lanes = 16;
using Mask = std::uint32_t;  // one bit per lane

// A block has 16 volumes, [axis][end of the step][low, high][lane]. A node has one volume,
// [end of the step][low, high][axis slot]. An empty lane or node is (inf, -inf) on every axis.

// The 16 features of a leaf: volumes, vertices [vertex of the feature][lane], and the lanes in use.
struct LeafLanes {
  const float* block;
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

struct OverlapKernels {
  // The lanes of `block`, among `candidates`, that `node` overlaps.
  Mask (*lanes_of_node)(const float* node, int slots, const float* block, int axes, int times,
                        Mask candidates);
  // Finds pairs of features whose volumes overlap and that share no vertex. same: b is a, and each
  // unordered pair is found once. Features with a common vertex always overlap, so the order of the
  // two tests does not matter.
  void (*leaf_pair)(const LeafLanes& a, const LeafLanes& b, int axes, int times, bool same,
                    Overlaps& out);
};

// The fastest kernels that this processor can run. All variants give the same result.
const OverlapKernels& overlap_kernels();
// For tests: the kernels "portable", "avx2" or "avx512"; null if the processor cannot run them.
const OverlapKernels* overlap_kernels(const char* name);

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
