// The pairs of features of two overlapping leaves that must be asked about.
#pragma once

#include <cstdint>
#include <vector>

#include "feature_tree.hpp"
#include "front.hpp"

namespace tauguard::cloth {

// Candidates in the form the narrow phase takes: `rows` holds 4 vertices a query (vertex and face,
// or edge and edge), `pairs` the numbers of the two features.
struct CandidateBlock {
  // Where a block is handed on, and the room that the leaf pair before that may still need.
  static constexpr std::size_t full = 2048, capacity = full + lanes * lanes;
  std::vector<std::int32_t> rows = std::vector<std::int32_t>(4 * capacity);
  std::vector<std::int32_t> pairs = std::vector<std::int32_t>(2 * capacity);
  std::size_t size = 0;
  std::uint64_t adjacent = 0,
                kept_apart = 0;  // left out: sharing a vertex; of groups that do not meet
};

// Isolated edges and vertices stand behind the triangles (topology.hpp): `first` is the number of
// the first of them, `point` marks the isolated vertices. Only isolated vertices are tested with
// them, and each pair of isolated vertices once.
struct Isolated {
  std::int32_t first;
  const std::uint8_t* point;
  bool meet(std::int32_t vertex, std::int32_t face, std::int32_t a, std::int32_t b) const {
    return face < first || (point[vertex] && (a != b || vertex < a));
  }
};

// Appends the candidates of one leaf pair: features whose own volumes overlap, share no vertex and
// may meet. Edges come smaller number first; vertices and faces come vertex first. `out` must not
// be full.
void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves,
                     const Groups& groups, const Isolated& isolated, CandidateBlock& out);

}  // namespace tauguard::cloth
