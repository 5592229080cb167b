#include "candidates.hpp"

#include "lanes.hpp"
#include "overlap.hpp"

namespace tauguard::cloth {
namespace {

template <int ArityA, int ArityB>
void emit(const std::int32_t* ids_a, const std::int32_t* va, int i, const std::int32_t* ids_b,
          const std::int32_t* vb, Mask hits, const Groups& groups, CandidateBlock& out) {
  std::int32_t a[ArityA];
  for (int j = 0; j < ArityA; ++j) a[j] = va[j * lanes + i];
  static const auto lanes_sharing = overlap_kernels().lanes_sharing;
  const Mask shared = hits & lanes_sharing(a, ArityA, vb, ArityB);
  out.adjacent += count_of(shared);
  hits &= ~shared;
  std::int32_t *row = out.rows.data() + 4 * out.size, *pair = out.pairs.data() + 2 * out.size;
  // Every hit is written; the place is taken only by those that count (no branch to mispredict).
  for (; hits; hits &= hits - 1) {
    const int lane = __builtin_ctz(hits);
    // A vertex goes by its own number, not by its place among the vertices in use.
    const std::int32_t id_a = ArityA == 1 ? a[0] : ids_a[i], id_b = ids_b[lane];
    const bool swap = ArityA == ArityB && id_a > id_b;
    const int at_a = swap ? ArityB : 0, at_b = swap ? 0 : ArityA;
    for (int k = 0; k < ArityB; ++k) row[at_b + k] = vb[k * lanes + lane];
    for (int j = 0; j < ArityA; ++j) row[at_a + j] = a[j];
    pair[0] = swap ? id_b : id_a;
    pair[1] = swap ? id_a : id_b;
    const bool meet =
        !groups.any() || groups.meet(groups.of_vertex[a[0]], groups.of_vertex[vb[lane]]);
    out.kept_apart += !meet;
    row += 4 * meet;
    pair += 2 * meet;
  }
  out.size = (pair - out.pairs.data()) / 2;
}

}  // namespace

void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves, const Groups& groups,
                     CandidateBlock& out) {
  static const OverlapKernels& kernels = overlap_kernels();
  const bool edges = &a == &b;
  const float *block_a = a.block(leaves.a), *block_b = b.block(leaves.b);
  Mask rows = a.occupied(leaves.a);
  const bool same = edges && leaves.a == leaves.b;
  if (!same)
    rows = kernels.lanes_of_node(b.node(b.leaves() + leaves.b), a.slots(), block_a, a.axes(), a.times(), rows);
  if (rows == 0) return;
  std::uint16_t masks[lanes];
  rows = kernels.rows_of_block(block_a, rows, block_b, a.axes(), a.times(), b.occupied(leaves.b), masks);
  const std::int32_t *ids_a = a.ids(leaves.a), *ids_b = b.ids(leaves.b);
  const std::int32_t *va = a.vertices(leaves.a), *vb = b.vertices(leaves.b);
  for (; rows; rows &= rows - 1) {
    const int i = __builtin_ctz(rows);
    Mask hits = masks[i];
    if (same) hits &= ~Mask(0) << i << 1;  // each unordered pair once
    if (hits == 0) continue;
    if (edges) {
      emit<2, 2>(ids_a, va, i, ids_b, vb, hits, groups, out);
    } else {
      emit<1, 3>(ids_a, va, i, ids_b, vb, hits, groups, out);
    }
  }
}

}  // namespace tauguard::cloth
