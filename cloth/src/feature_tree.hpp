// A bounding-volume tree over the features of a mesh (vertices, edges or faces), 16 to a leaf.
//
// The tree is a left-complete binary heap: node 1 is the root, the children of i are 2 i and 2 i +
// 1, and leaf l is node leaves() + l. It is built top-down (median of the centroids along the
// longest axis) and refitted every step. Free slots in the leaves allow additions without a
// rebuild.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "k_dop.hpp"
#include "overlap.hpp"

namespace tauguard::cloth {

// Features of one kind: row i has the `arity` vertices of feature i.
struct Features {
  int arity = 1;
  std::vector<std::int32_t> vertices;
  std::size_t size() const { return vertices.size() / arity; }
  const std::int32_t* of(std::size_t i) const { return vertices.data() + arity * i; }
};

// The group of each vertex, and a symmetric table of the groups to test against each other. Without
// groups all vertices are tested.
struct Groups {
  std::vector<std::int32_t> of_vertex;
  std::vector<std::uint8_t> meets;  // count x count
  std::int32_t count = 0;
  bool any() const { return count > 0; }
  bool meet(std::int32_t a, std::int32_t b) const { return meets[std::size_t(a) * count + b] != 0; }
};

class FeatureTree {
 public:
  // Places every feature by the centroid that its vertices have at the start of the step. The upper
  // levels of the tree divide the groups, the lower ones divide space.
  void build(const Features& features, const Ends& x, const Groups& groups, int threads);
  // Computes the bounds of every leaf and node for this step, in 16 bits or floats as the points.
  void refit(const Projection& points, int threads);
  // Replaces the features by `features`. Old feature i becomes new_id[i]; -1 removes it. New
  // features are placed near features that share their vertices. False if there are not enough free
  // slots; then build() must be called.
  bool update(const Features& features, const std::vector<std::int32_t>& new_id,
              const Groups& groups);

  std::int32_t leaves() const { return leaves_; }
  int arity() const { return arity_; }
  int times() const { return times_; }
  int axes() const { return axes_; }
  int slots() const { return slots_; }
  bool is_leaf(std::int32_t node) const { return node >= leaves_; }
  template <class Bound>
  const Bound* node(std::int32_t i) const {
    return bounds<Bound>().nodes.data() + std::size_t(i) * node_stride();
  }
  const void* node(std::int32_t i) const {
    if (short_) return node<std::int16_t>(i);
    return node<float>(i);
  }
  std::size_t node_bytes() const { return node_stride() * (short_ ? 2 : 4); }
  // Whether bounds have 16 bits.
  bool is_short() const { return short_; }
  template <class Bound>
  LeafLanes<Bound> lanes_of(std::int32_t leaf) const {
    return {bounds<Bound>().blocks.data() + std::size_t(leaf) * block_stride(), vertices(leaf),
            arity_, occupied_[leaf]};
  }
  // Prefetches the volumes and vertices of a leaf.
  void prefetch(std::int32_t leaf) const;
  const std::int32_t* ids(std::int32_t leaf) const {
    return ids_.data() + std::size_t(leaf) * lanes;
  }
  // [vertex of the feature][lane]
  const std::int32_t* vertices(std::int32_t leaf) const {
    return vertices_.data() + std::size_t(leaf) * lanes * arity_;
  }
  bool may_meet(std::int32_t i, const FeatureTree& other, std::int32_t j) const {
    return members_.empty() || (members_[i] & other.partners_[j]) != 0;
  }
  // The sum of the leaves' extents along x, y and z, a measure of how spread out the leaves are.
  double spread() const { return spread_; }
  std::size_t bytes() const;

 private:
  std::size_t node_stride() const { return 2 * std::size_t(slots_) * times_; }
  std::size_t block_stride() const { return 2 * std::size_t(lanes) * times_ * axes_; }
  template <class Bound>
  struct Bounds {
    LineVector<Bound> nodes, blocks;
    std::size_t bytes() const { return (nodes.capacity() + blocks.capacity()) * sizeof(Bound); }
  };
  template <class Bound>
  const Bounds<Bound>& bounds() const {
    if constexpr (sizeof(Bound) == sizeof(std::int16_t))
      return shorts_;
    else
      return floats_;
  }
  template <int slots, class Bound>
  void fit_leaf(std::int32_t leaf, const Projection& points, Bounds<Bound>& out) const;
  template <int slots, class Bound>
  void fit(const Projection& points, int threads, Bounds<Bound>& out);
  void put(std::int32_t leaf, int lane, std::int32_t id, const Features& features);
  std::int32_t free_leaf_near(std::int32_t leaf) const;
  void fill_groups(const Features& features, const Groups& groups);

  int arity_ = 1, axes_ = 0, slots_ = 0, times_ = 0;
  std::int32_t leaves_ = 0;
  bool added_ = false;  // update() has added features
  bool short_ = false;
  double spread_ = 0;
  Bounds<float> floats_;
  Bounds<std::int16_t> shorts_;           // this or floats_ is empty
  std::vector<std::int32_t> ids_, free_;  // free_: number of empty slots below every node
  LineVector<std::int32_t> vertices_;
  std::vector<Mask> occupied_;
  std::vector<std::uint64_t> members_,
      partners_;  // bits (modulo 64): groups below a node; groups that these may meet
};

}  // namespace tauguard::cloth
