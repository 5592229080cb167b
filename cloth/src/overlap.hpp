// Which of 16 bounding volumes a volume overlaps: the inner loop of the broad phase.
#pragma once

#include <cstdint>

namespace tauguard::cloth {

inline constexpr int lanes = 16;
using Mask = std::uint32_t;  // a bit per lane

// A block holds 16 volumes lane by lane: [axis][end of the step][low, high][lane]. A node holds one, axis
// by axis: [end of the step][low, high][axis slot]. An empty lane or node is (inf, -inf) everywhere.
struct OverlapKernels {
  // Of `candidates`, the lanes of `block` that `node` does not stand apart from.
  Mask (*lanes_of_node)(const float* node, int slots, const float* block, int axes, int times,
                        Mask candidates);
  // For every row in `rows` (a lane of `a`): out[row] = the lanes of `b`, of `candidates`, that it does
  // not stand apart from. The rows that have any.
  Mask (*rows_of_block)(const float* a, Mask rows, const float* b, int axes, int times, Mask candidates,
                        std::uint16_t* out);
  // The lanes of `b`, 16 features as [vertex][lane], that share a vertex with one feature, `a`.
  Mask (*lanes_sharing)(const std::int32_t* a, int arity_a, const std::int32_t* b, int arity_b);
};

// The fastest that this processor runs. Comparisons only: every variant gives the same bits.
const OverlapKernels& overlap_kernels();
// By name, for tests: "portable", "avx2", "avx512"; null where the processor lacks it.
const OverlapKernels* overlap_kernels(const char* name);

// Two nodes: no axis separates them on the same side at every end.
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
  if (times == 1) return slots == 4 ? nodes_overlap<4, 1> : slots == 8 ? nodes_overlap<8, 1> : nodes_overlap<16, 1>;
  return slots == 4 ? nodes_overlap<4, 2> : slots == 8 ? nodes_overlap<8, 2> : nodes_overlap<16, 2>;
}

}  // namespace tauguard::cloth
