// The pairs of features of two overlapping leaves that the narrow phase must test.
#pragma once

#include <cstdint>
#include <vector>

#include "feature_tree.hpp"
#include "front.hpp"

namespace tauguard::cloth {

// Input of the narrow phase. `rows` has the 4 vertices of each query (of a vertex and a face, or of
// two edges). `pairs` has the numbers of the two features.
struct CandidateBlock {
  // A block is passed on when it has at least `full` candidates. `capacity` includes room for the
  // candidates of one more pair of leaves.
  static constexpr std::size_t full = 2048, capacity = full + lanes * lanes;
  std::vector<std::int32_t> rows = std::vector<std::int32_t>(4 * capacity);
  std::vector<std::int32_t> pairs = std::vector<std::int32_t>(2 * capacity);
  std::size_t size = 0;
  // Numbers of pairs left out because they share a vertex (`adjacent`) or because their groups
  // never touch (`kept_apart`).
  std::uint64_t adjacent = 0, kept_apart = 0;
};

// Isolated edges and vertices, which belong to no triangle (topology.hpp). They are numbered after
// the triangles; `first` is the lowest of these numbers. `point` marks the isolated vertices. Only
// isolated vertices are tested against isolated features, and each pair of isolated vertices is
// tested once.
struct Isolated {
  std::int32_t first;
  const std::uint8_t* point;  // null: there are none
  bool meet(std::int32_t vertex, std::int32_t face, std::int32_t a, std::int32_t b) const {
    return face < first || (point[vertex] && (a != b || vertex < a));
  }
};

// Appends the candidates of one pair of leaves to `out`, which must not be full. The two features
// of a candidate share no vertex, their bounding volumes overlap, and their groups are tested. The
// order in a pair is vertex and face, or edge of smaller number and edge of larger number.
void leaf_candidates(const FeatureTree& a, const FeatureTree& b, NodePair leaves,
                     const Groups& groups, const Isolated& isolated, CandidateBlock& out);

}  // namespace tauguard::cloth
