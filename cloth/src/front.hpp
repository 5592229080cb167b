// The bounding-volume traversal tree of two feature trees (or one with itself) and its front.
//
// The nodes of this tree are pairs of nodes of the feature trees. To get the children of a pair,
// each of its nodes that is not a leaf is split. The front is a cut through this tree: every pair
// of leaves is an entry of the front, or below exactly one. In coherent motion the entries hardly
// change from step to step, so the descent starts from the last front and not from the root (Li &
// Chen 1998; Tang et al. 2010). The overlapping pairs of leaves do not depend on the front, because
// a child is within its parent.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "feature_tree.hpp"

namespace tauguard::cloth {

struct NodePair {
  std::int32_t a, b;
};

class Front {
 public:
  // Discards the front; the next update starts near the root.
  void reset() { cut_.clear(); }
  // Updates the front for the present volumes and returns the overlapping pairs of leaf numbers. To
  // test a tree against itself, pass it twice; each unordered pair is visited once. Throws TooMany
  // if the front has more than `limit` entries; call reset then.
  const std::vector<NodePair>& update(const FeatureTree& a, const FeatureTree& b, int threads,
                                      std::size_t limit);

  std::size_t size() const { return cut_.size(); }
  std::size_t tests() const { return tests_; }  // number of tested node pairs in the last update
  std::size_t bytes() const {
    return (cut_.capacity() + leaf_pairs_.capacity()) * sizeof(NodePair);
  }

 private:
  std::vector<NodePair> cut_, leaf_pairs_;
  std::size_t tests_ = 0;
};

}  // namespace tauguard::cloth
