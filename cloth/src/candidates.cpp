#include "candidates.hpp"

#include "overlap.hpp"

namespace tauguard::cloth {
namespace {

template <int ArityA, int ArityB>
void emit(const std::int32_t* ids_a, const std::int32_t* va, int i, const std::int32_t* ids_b,
          const std::int32_t* vb, Mask hits, const Groups& groups, const Isolated& isolated,
          CandidateBlock& out) {
  std::int32_t a[ArityA];
  for (int j = 0; j < ArityA; ++j) a[j] = va[j * lanes + i];
  std::int32_t *row = out.rows.data() + 4 * out.size, *pair = out.pairs.data() + 2 * out.size;
  // Every pair is written, but the position advances only for hits (no branch to mispredict).
  for (; hits; hits &= hits - 1) {
    const int lane = __builtin_ctz(hits);
    // Vertices are named by their own number, not by their position among the vertices in use.
    const std::int32_t id_a = ArityA == 1 ? a[0] : ids_a[i], id_b = ids_b[lane];
    const bool swap = ArityA == ArityB && id_a > id_b;
    const int at_a = swap ? ArityB : 0, at_b = swap ? 0 : ArityA;
    for (int k = 0; k < ArityB; ++k) row[at_b + k] = vb[k * lanes + lane];
    for (int j = 0; j < ArityA; ++j) row[at_a + j] = a[j];
    pair[0] = swap ? id_b : id_a;
    pair[1] = swap ? id_a : id_b;
    bool meet = !groups.any() || groups.meet(groups.of_vertex[a[0]], groups.of_vertex[vb[lane]]);
    out.kept_apart += !meet;
    if (ArityA == 1) meet = meet && isolated.meet(a[0], id_b, vb[lane], vb[lanes + lane]);
    row += 4 * meet;
    pair += 2 * meet;
  }
  out.size = (pair - out.pairs.data()) / 2;
}

}  // namespace

void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves,
                     const Groups& groups, const Isolated& isolated, CandidateBlock& out) {
  static const OverlapKernels& kernels = overlap_kernels();
  const bool edges = &a == &b, same = edges && leaves.a == leaves.b;
  LeafLanes left = a.lanes_of(leaves.a);
  const LeafLanes right = b.lanes_of(leaves.b);
  if (!same)  // x, y and z reject nearly all rows that any axis can
    left.occupied = kernels.lanes_of_node(b.node(b.leaves() + leaves.b), a.slots(), left.block, 3,
                                          a.times(), left.occupied);
  Overlaps found;
  kernels.leaf_pair(left, right, a.axes(), a.times(), same, found);
  out.adjacent += found.adjacent;
  const std::int32_t *ids_a = a.ids(leaves.a), *ids_b = b.ids(leaves.b);
  const std::int32_t *va = left.vertices, *vb = right.vertices;
  for (Mask rows = found.rows; rows; rows &= rows - 1) {
    const int i = __builtin_ctz(rows);
    const Mask hits = found.lanes_of[i];
    if (edges) {
      emit<2, 2>(ids_a, va, i, ids_b, vb, hits, groups, isolated, out);
    } else {
      emit<1, 3>(ids_a, va, i, ids_b, vb, hits, groups, isolated, out);
    }
  }
}

}  // namespace tauguard::cloth
