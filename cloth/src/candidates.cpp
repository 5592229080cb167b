#include "candidates.hpp"

#include <utility>

#include "overlap.hpp"

namespace tauguard::cloth {
namespace {

template <int ArityA, int ArityB>
void emit(const std::int32_t* ids_a, const std::int32_t* va, int i, const std::int32_t* ids_b,
          const std::int32_t* vb, Mask hits, const Groups& groups, CandidateBlock& out) {
  std::int32_t a[ArityA];
  for (int j = 0; j < ArityA; ++j) a[j] = va[j * lanes + i];
  for (; hits; hits &= hits - 1) {
    const int lane = __builtin_ctz(hits);
    std::int32_t row[ArityA + ArityB];
    bool shared = false;
    for (int k = 0; k < ArityB; ++k) {
      row[ArityA + k] = vb[k * lanes + lane];
      for (int j = 0; j < ArityA; ++j) shared |= a[j] == row[ArityA + k];
    }
    if (shared) {
      ++out.adjacent;
      continue;
    }
    if (groups.any() && !groups.meet(groups.of_vertex[a[0]], groups.of_vertex[row[ArityA]])) {
      ++out.kept_apart;
      continue;
    }
    for (int j = 0; j < ArityA; ++j) row[j] = a[j];
    // A vertex goes by its own number, not by its place among the vertices in use.
    std::int32_t first = ArityA == 1 ? a[0] : ids_a[i], second = ids_b[lane];
    if (ArityA == ArityB && first > second) {
      std::swap(first, second);
      for (int j = 0; j < ArityA; ++j) std::swap(row[j], row[ArityA + j]);
    }
    out.rows.insert(out.rows.end(), row, row + ArityA + ArityB);
    out.pairs.push_back(first);
    out.pairs.push_back(second);
  }
}

}  // namespace

void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves, const Groups& groups,
                     CandidateBlock& out) {
  static const OverlapKernels& kernels = overlap_kernels();
  const bool edges = &a == &b;
  const float *block_a = a.block(leaves.a), *block_b = b.block(leaves.b);
  Mask rows = a.occupied(leaves.a), columns = b.occupied(leaves.b);
  const bool same = edges && leaves.a == leaves.b;
  if (!same) {
    rows = kernels.lanes_of_node(b.node(b.leaves() + leaves.b), block_a, a.axes(), a.times(), rows);
    columns = kernels.lanes_of_node(a.node(a.leaves() + leaves.a), block_b, a.axes(), a.times(), columns);
    if (rows == 0 || columns == 0) return;
  }
  std::uint16_t masks[lanes];
  kernels.rows_of_block(block_a, rows, block_b, a.axes(), a.times(), columns, masks);
  const std::int32_t *ids_a = a.ids(leaves.a), *ids_b = b.ids(leaves.b);
  const std::int32_t *va = a.vertices(leaves.a), *vb = b.vertices(leaves.b);
  for (; rows; rows &= rows - 1) {
    const int i = __builtin_ctz(rows);
    Mask hits = masks[i];
    if (same) hits &= ~Mask(0) << i << 1;  // each unordered pair once
    if (edges) {
      emit<2, 2>(ids_a, va, i, ids_b, vb, hits, groups, out);
    } else {
      emit<1, 3>(ids_a, va, i, ids_b, vb, hits, groups, out);
    }
  }
}

}  // namespace tauguard::cloth
