// The bounding-volume traversal tree of two feature trees (or one with itself) and its front.
//
// Its nodes are pairs of tree nodes. Children: a pair at one depth splits both sides (the inner
// ones), else the side that is not yet a leaf. The front is a cut: every pair of leaves lies below
// exactly one entry. Between steps of a coherent motion the entries hardly change, so the descent
// starts from the last front and not from the root (Li & Chen 1998; Tang et al. 2010). Whatever the
// cut, the leaf pairs found are the same: a child lies within its parent.
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
  // Forgets the cut; the next update starts near the root.
  void reset() { cut_.clear(); }
  // Moves the front to where the trees now stand and returns the pairs of leaf numbers that
  // overlap. For a tree with itself pass the same tree twice: each unordered pair is visited once.
  // Throws TooMany where the cut outgrows `limit`; reset comes next then.
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
