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
// [end of the step][low, high][axis slot]. Bounds are floats or 16 bits (k_dop.hpp). An empty lane
// or node has a lower bound above every upper bound on every axis.

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
  Mask (*lanes_of_node)(const Bound* node, int slots, const Bound* block, int times,
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

// The lower or upper bounds of a node at one end of the step.
template <int slots, class Bound>
struct SideOf {
  typedef Bound Type __attribute__((vector_size(slots * sizeof(Bound))));
};
template <int slots, class Bound>
using Side = typename SideOf<slots, Bound>::Type;

// Whether no axis separates two nodes on the same side at all ends.
template <int slots, int times, class Bound>
bool nodes_overlap(const void* node_a, const void* node_b) {
  Side<slots, Bound> a[2 * times], b[2 * times];  // [end][low, high]
  std::memcpy(a, node_a, sizeof a);
  std::memcpy(b, node_b, sizeof b);
  constexpr int end = 2 * (times - 1);
  const auto apart =
      ((a[1] < b[0]) & (a[end + 1] < b[end])) | ((b[1] < a[0]) & (b[end + 1] < a[end]));
  std::uint64_t word[sizeof apart / 8], any = 0;
  std::memcpy(word, &apart, sizeof apart);
  for (const auto w : word) any |= w;
  return any == 0;
}

using NodeTest = bool (*)(const void*, const void*);
template <int times, class Bound>
NodeTest node_test(int slots) {
  return slots == 4   ? nodes_overlap<4, times, Bound>
         : slots == 8 ? nodes_overlap<8, times, Bound>
                      : nodes_overlap<16, times, Bound>;
}
template <class Bound>
NodeTest node_test(int slots, int times) {
  return times == 1 ? node_test<1, Bound>(slots) : node_test<2, Bound>(slots);
}

}  // namespace tauguard::cloth
