#include "feature_tree.hpp"

#include <algorithm>
#include <numeric>
#include <utility>

#include "tauguard/geometry/aabb.hpp"
#include "tauguard/geometry/thread_pool.hpp"
#include "vertex_table.hpp"

namespace tauguard::cloth {
namespace {

using geometry::Aabb;
using geometry::ThreadPool;

// Largest number of features per leaf in a build: `full` until update() first adds features, and
// `with_room` from then on, which leaves free slots for later additions.
constexpr std::size_t full = lanes, with_room = 13;

struct Centroid {
  double x[3];
  std::int32_t group;
};

// Sorts order[begin, end) so that the first `left` entries belong to the left child.
void split(std::vector<std::int32_t>& order, std::size_t begin, std::size_t left, std::size_t end,
           const std::vector<Centroid>& at) {
  Aabb box;
  bool mixed = false;
  for (auto i = begin; i < end; ++i) {
    box.add(at[order[i]].x);
    mixed |= at[order[i]].group != at[order[begin]].group;
  }
  const int axis = box.longest_axis();
  const auto before = [&](std::int32_t a, std::int32_t b) {
    if (mixed && at[a].group != at[b].group) return at[a].group < at[b].group;
    if (at[a].x[axis] != at[b].x[axis]) return at[a].x[axis] < at[b].x[axis];
    return a < b;
  };
  std::nth_element(order.begin() + begin, order.begin() + begin + left, order.begin() + end,
                   before);
}

std::vector<Centroid> centroids(const Features& features, const Ends& x, const Groups& groups) {
  std::vector<Centroid> at(features.size());
  const double share = 1.0 / features.arity;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const std::int32_t* v = features.of(i);
    at[i] = {{0, 0, 0}, groups.any() ? groups.of_vertex[v[0]] : 0};
    for (int j = 0; j < features.arity; ++j)
      for (int k = 0; k < 3; ++k) at[i].x[k] += share * x.at(false, v[j])[k];
  }
  return at;
}

}  // namespace

void FeatureTree::build(const Features& features, const Ends& x, const Groups& groups,
                        int threads) {
  arity_ = features.arity;
  const std::size_t fill = added_ ? with_room : full;
  const std::size_t n = std::max<std::size_t>(1, (features.size() + fill - 1) / fill);
  leaves_ = static_cast<std::int32_t>(n);
  ids_.assign(n * lanes, -1);
  vertices_.assign(n * lanes * arity_, -1);
  occupied_.assign(n, 0);
  free_.assign(2 * n, lanes);
  floats_ = {};
  shorts_ = {};

  const auto at = centroids(features, x, groups);
  std::vector<std::int32_t> order(features.size());
  std::iota(order.begin(), order.end(), 0);
  // For each node: the number of leaves below it, the first of them, and the range of their
  // features. Leaf i from the left starts with feature i * size / n, so the numbers of features in
  // leaves differ by at most one.
  std::vector<std::size_t> count(2 * n, 1), first(2 * n, 0), begin(2 * n, 0), end(2 * n, 0);
  for (std::size_t i = n - 1; i >= 1; --i) count[i] = count[2 * i] + count[2 * i + 1];
  end[1] = order.size();
  for (std::size_t level = 1; level < 2 * n; level *= 2) {
    const std::size_t last = std::min(2 * level, 2 * n);
    ThreadPool::shared().parallel_for(last - level, threads, 16, [&](auto from, auto to, auto) {
      for (auto i = level + from; i < level + to; ++i) {
        if (i >= n) {
          for (auto s = begin[i]; s < end[i]; ++s)
            put(static_cast<std::int32_t>(i - n), static_cast<int>(s - begin[i]), order[s],
                features);
          continue;
        }
        first[2 * i] = first[i];
        first[2 * i + 1] = first[i] + count[2 * i];
        const std::size_t middle = first[2 * i + 1] * order.size() / n;
        if (middle < end[i]) split(order, begin[i], middle - begin[i], end[i], at);
        begin[2 * i] = begin[i];
        end[2 * i] = begin[2 * i + 1] = middle;
        end[2 * i + 1] = end[i];
      }
    });
  }
  for (std::size_t i = n - 1; i >= 1; --i) free_[i] = free_[2 * i] + free_[2 * i + 1];
  fill_groups(features, groups);
}

void FeatureTree::put(std::int32_t leaf, int lane, std::int32_t id, const Features& features) {
  ids_[std::size_t(leaf) * lanes + lane] = id;
  for (int j = 0; j < arity_; ++j)
    vertices_[(std::size_t(leaf) * arity_ + j) * lanes + lane] = id < 0 ? -1 : features.of(id)[j];
  const Mask bit = Mask(1) << lane;
  if (id >= 0 && !(occupied_[leaf] & bit)) --free_[leaves_ + leaf];
  if (id < 0 && (occupied_[leaf] & bit)) ++free_[leaves_ + leaf];
  occupied_[leaf] = id < 0 ? occupied_[leaf] & ~bit : occupied_[leaf] | bit;
}

void FeatureTree::fill_groups(const Features& features, const Groups& groups) {
  members_.assign(groups.any() ? 2 * std::size_t(leaves_) : 0, 0);
  partners_ = members_;
  if (!groups.any()) return;
  std::vector<std::uint64_t> partners_of(groups.count, 0);
  for (std::int32_t a = 0; a < groups.count; ++a)
    for (std::int32_t b = 0; b < groups.count; ++b)
      if (groups.meet(a, b)) partners_of[a] |= std::uint64_t(1) << (b % 64);
  for (std::size_t slot = 0; slot < ids_.size(); ++slot) {
    if (ids_[slot] < 0) continue;
    const std::int32_t group = groups.of_vertex[features.of(ids_[slot])[0]];
    members_[leaves_ + slot / lanes] |= std::uint64_t(1) << (group % 64);
    partners_[leaves_ + slot / lanes] |= partners_of[group];
  }
  for (std::int32_t i = leaves_ - 1; i >= 1; --i) {
    members_[i] = members_[2 * i] | members_[2 * i + 1];
    partners_[i] = partners_[2 * i] | partners_[2 * i + 1];
  }
}

std::int32_t FeatureTree::free_leaf_near(std::int32_t leaf) const {
  std::int32_t node = leaves_ + leaf;
  while (node > 1 && free_[node] == 0) node /= 2;
  if (free_[node] == 0) return -1;
  while (!is_leaf(node)) node = free_[2 * node] > 0 ? 2 * node : 2 * node + 1;
  return node - leaves_;
}

bool FeatureTree::update(const Features& features, const std::vector<std::int32_t>& new_id,
                         const Groups& groups) {
  std::vector<std::int32_t> missing;
  std::vector<std::uint8_t> placed(features.size(), 0);
  for (const auto id : new_id)
    if (id >= 0) placed[id] = 1;
  for (std::size_t i = 0; i < placed.size(); ++i)
    if (!placed[i]) missing.push_back(static_cast<std::int32_t>(i));
  // Full leaves have no free slots, so the first added features rebuild the tree with free slots.
  if (!missing.empty() && !std::exchange(added_, true)) return false;

  for (std::int32_t leaf = 0; leaf < leaves_; ++leaf)
    for (int lane = 0; lane < lanes; ++lane) {
      std::int32_t& id = ids_[std::size_t(leaf) * lanes + lane];
      if (id < 0) continue;
      if (new_id[id] < 0) {
        put(leaf, lane, -1, features);
      } else {
        id = new_id[id];  // the new number of the same feature
      }
    }
  for (std::int32_t i = leaves_ - 1; i >= 1; --i) free_[i] = free_[2 * i] + free_[2 * i + 1];

  // Find a leaf for each vertex; new features are placed in the leaf of one of their vertices.
  const auto used =
      used_vertices(missing.empty() ? std::vector<std::int32_t>() : features.vertices);
  const VertexTable table(used);
  std::vector<std::int32_t> leaf_at(used.size(), -1);
  for (std::size_t i = 0; i < vertices_.size() && !used.empty(); ++i)
    if (vertices_[i] >= 0)
      leaf_at[table.place(vertices_[i])] = static_cast<std::int32_t>(i / (lanes * arity_));
  std::int32_t near = 0;
  for (const auto id : missing) {
    for (int j = 0; j < arity_; ++j) {
      const std::int32_t there = leaf_at[table.place(features.of(id)[j])];
      if (there >= 0) near = there;
    }
    const std::int32_t leaf = free_leaf_near(near);
    if (leaf < 0) return false;
    const int lane = __builtin_ctz(~occupied_[leaf]);
    put(leaf, lane, id, features);
    for (std::int32_t i = (leaves_ + leaf) / 2; i >= 1; i /= 2) --free_[i];
    for (int j = 0; j < arity_; ++j) leaf_at[table.place(features.of(id)[j])] = leaf;
  }
  fill_groups(features, groups);
  return true;
}

void FeatureTree::prefetch(std::int32_t leaf) const {
  constexpr int line = 64;
  const auto bytes = [](const auto* from, std::size_t n) {
    for (std::size_t i = 0; i < n * sizeof *from; i += line)
      __builtin_prefetch(reinterpret_cast<const char*>(from) + i);
  };
  short_ ? bytes(lanes_of<std::int16_t>(leaf).block, block_stride())
         : bytes(lanes_of<float>(leaf).block, block_stride());
  bytes(static_cast<const char*>(node(leaves_ + leaf)), node_bytes());
  bytes(vertices(leaf), lanes * arity_);
  bytes(ids(leaf), 1);
}

std::size_t FeatureTree::bytes() const {
  return floats_.bytes() + shorts_.bytes() +
         (ids_.capacity() + vertices_.capacity() + free_.capacity()) * sizeof(std::int32_t) +
         occupied_.capacity() * sizeof(Mask) +
         (members_.capacity() + partners_.capacity()) * sizeof(std::uint64_t);
}

}  // namespace tauguard::cloth
