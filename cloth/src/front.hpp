// The bounding-volume traversal tree of two feature trees (or one with itself) and its front.
//
// Its nodes are pairs of tree nodes. The children of a pair split both nodes if these have the same
// depth, and otherwise the node that is not a leaf. The front is a cut: every pair of leaves lies
// below exactly one entry. Between steps of a coherent motion the entries hardly change, so the
// descent starts from the last front and not from the root (Li & Chen 1998; Tang et al. 2010). The
// leaf pairs found do not depend on the cut, because a child lies within its parent.
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
  // Discards the cut; the next update starts near the root.
  void reset() { cut_.clear(); }
  // Moves the front to the present volumes and returns the pairs of leaf numbers that overlap. To
  // test a tree against itself, pass it twice; each unordered pair is visited once. Throws TooMany
  // if the cut outgrows `limit`; call reset then.
  const std::vector<NodePair>& update(const FeatureTree& a, const FeatureTree& b, int threads,
                                      std::size_t limit);

  std::size_t size() const { return cut_.size(); }
  std::size_t tests() const { return tests_; }  // of node pairs in the last update
  std::size_t bytes() const {
    return (cut_.capacity() + leaf_pairs_.capacity()) * sizeof(NodePair);
  }

 private:
  std::vector<NodePair> cut_, leaf_pairs_;
  std::size_t tests_ = 0;
};

}  // namespace tauguard::cloth
