#include "candidates.hpp"

#include "overlap.hpp"

namespace tauguard::cloth {
namespace {

// `some`: groups or isolated features exclude some pairs.
template <int arity_a, int arity_b, bool some>
void emit(const std::int32_t* ids_a, const std::int32_t* va, const std::int32_t* ids_b,
          const std::int32_t* vb, const Overlaps& found, const Groups& groups,
          const Isolated& isolated, CandidateBlock& out) {
  std::int32_t *row = out.rows.data() + 4 * out.size, *pair = out.pairs.data() + 2 * out.size;
  for (Mask rows = found.rows; rows; rows &= rows - 1) {
    const int i = __builtin_ctz(rows);
    std::int32_t a[arity_a];
    for (int j = 0; j < arity_a; ++j) a[j] = va[j * lanes + i];
    // The number of a vertex is its row in the positions, not its rank among the vertices in use.
    const std::int32_t id_a = arity_a == 1 ? a[0] : ids_a[i];
    for (Mask hits = found.lanes_of[i]; hits; hits &= hits - 1) {
      const int lane = __builtin_ctz(hits);
      const std::int32_t id_b = ids_b[lane];
      // Computed, not chosen: half of the branches would be mispredicted.
      const int swap = (arity_a == arity_b) & (id_a > id_b), at_a = arity_b * swap,
                at_b = arity_a * (1 - swap);
      for (int k = 0; k < arity_b; ++k) row[at_b + k] = vb[k * lanes + lane];
      for (int j = 0; j < arity_a; ++j) row[at_a + j] = a[j];
      pair[swap] = id_a;
      pair[1 - swap] = id_b;
      bool meet = true;
      if (some) {  // the pair is written already; keep it only if the features may meet
        meet = !groups.any() || groups.meet(groups.of_vertex[a[0]], groups.of_vertex[vb[lane]]);
        out.kept_apart += !meet;
        if (arity_a == 1) meet = meet && isolated.meet(a[0], id_b, vb[lane], vb[lanes + lane]);
      }
      row += 4 * meet;
      pair += 2 * meet;
    }
  }
  out.size = (pair - out.pairs.data()) / 2;
}

template <class Bound>
void leaf_candidates_in(const FeatureTree& a, const FeatureTree& b, NodePair leaves,
                        const Groups& groups, const Isolated& isolated, CandidateBlock& out) {
  static const OverlapKernels<Bound>& kernels = overlap_kernels<Bound>();
  const bool edges = &a == &b, same = edges && leaves.a == leaves.b;
  LeafLanes<Bound> left = a.lanes_of<Bound>(leaves.a);
  const LeafLanes<Bound> right = b.lanes_of<Bound>(leaves.b);
  if (!same)  // the first three axes reject nearly all rows that can be rejected
    left.occupied = kernels.lanes_of_node(b.node<Bound>(b.leaves() + leaves.b), a.slots(),
                                          left.block, a.times(), left.occupied);
  Overlaps found;
  kernels.leaf_pair(left, right, a.axes(), a.times(), same, found);
  out.adjacent += found.adjacent;
  const auto write = edges ? groups.any() ? emit<2, 2, true> : emit<2, 2, false>
                     : groups.any() || isolated.point ? emit<1, 3, true>
                                                      : emit<1, 3, false>;
  write(a.ids(leaves.a), left.vertices, b.ids(leaves.b), right.vertices, found, groups, isolated,
        out);
}

}  // namespace

void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves,
                     const Groups& groups, const Isolated& isolated, CandidateBlock& out) {
  a.is_short() ? leaf_candidates_in<std::int16_t>(a, b, leaves, groups, isolated, out)
               : leaf_candidates_in<float>(a, b, leaves, groups, isolated, out);
}

}  // namespace tauguard::cloth
