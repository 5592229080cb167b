#include "front.hpp"

#include <algorithm>
#include <atomic>

#include "tauguard/geometry/interrupt.hpp"
#include "too_many.hpp"

namespace tauguard::cloth {
namespace {

// Numbers of entries in a chunk. An entry of the last step's front (`kept_grain`) needs about one
// test, an entry of the first front (`root_grain`) a whole descent.
constexpr std::size_t kept_grain = 1024, root_grain = 16;
constexpr int first_depth = 5;  // the first front has all pairs of nodes of this depth

int depth(std::int32_t node) { return 31 - __builtin_clz(static_cast<unsigned>(node)); }

// Number of entries written to the new front so far, over all chunks.
struct Total {
  std::size_t limit;
  std::atomic<std::size_t> entries{0};
  void add(std::size_t more) {
    if ((entries += more) > limit) throw TooMany("pairs of tree nodes (8 times limit)", limit);
  }
};

// Processes one chunk of the front, and writes a new one to `cut` if its entries change.
class Walk {
 public:
  Walk(const FeatureTree& a, const FeatureTree& b, Total& total)
      : a_(a),
        b_(b),
        self_(&a == &b),
        test_(a.is_short() ? node_test<std::int16_t>(a.slots(), a.times())
                           : node_test<float>(a.slots(), a.times())),
        total_(total) {}

  // Splits each node that is not a leaf. If the depths differ, the shallower node is a leaf.
  int children(NodePair p, NodePair* child) const {
    const int gap = depth(p.a) - depth(p.b);
    const bool split_a = gap >= 0 && !a_.is_leaf(p.a), split_b = gap <= 0 && !b_.is_leaf(p.b);
    int n = 0;
    for (int i = 0; i <= int(split_a); ++i)
      for (int j = 0; j <= int(split_b); ++j) {
        const NodePair c{split_a ? 2 * p.a + i : p.a, split_b ? 2 * p.b + j : p.b};
        if (!(self_ && p.a == p.b && c.a > c.b)) child[n++] = c;
      }
    return n;
  }

  // Processes `n` entries of the front, at most a chunk. If consecutive entries are all children of
  // one pair, and the nodes are apart in each entry and in that pair, the pair replaces them.
  void move(const NodePair* entry, int n) {
    bool meet[kept_grain];
    for (int i = 0; i < n; ++i) {
      // Nodes are scattered in memory, so the nodes of later entries are prefetched.
      const NodePair& later = entry[std::min(i + ahead, n - 1)];
      fetch(a_, later.a);
      fetch(b_, later.b);
      meet[i] = meets(entry[i]);
    }
    look_up();
    // Most entries stay. Pairs of leaves are written without a (mispredicted) branch.
    NodePair found[kept_grain];
    int count = 0;
    for (int i = 0; i < n; ++i) {
      const NodePair p = entry[i];
      const bool leaves = both_leaves(p);
      found[count] = leaf_numbers(p);
      count += meet[i] & leaves;
      if (meet[i] && !leaves) {
        leaf_pairs.insert(leaf_pairs.end(), found, found + count);
        count = 0;
        differ(entry, i);
        enter(p);
      } else if (const int row = meet[i] ? 0 : apart_siblings(entry + i, meet + i, n - i)) {
        differ(entry, i);
        cut.push_back(parent(p));
        i += row - 1;
      } else if (differs) {
        cut.push_back(p);
      }
    }
    leaf_pairs.insert(leaf_pairs.end(), found, found + count);
  }

  std::vector<NodePair> cut, leaf_pairs;
  bool differs = false;  // if false, the old entries are kept and `cut` is empty
  std::size_t tests = 0;

 private:
  static constexpr std::size_t pause = 1024;  // number of tests between two calls of look_up
  static constexpr int ahead = 8;

  bool meets(NodePair p) {
    ++tests;
    return a_.may_meet(p.a, b_, p.b) && test_(a_.node(p.a), b_.node(p.b));
  }
  bool both_leaves(NodePair p) const { return a_.is_leaf(p.a) & b_.is_leaf(p.b); }
  NodePair leaf_numbers(NodePair p) const { return {p.a - a_.leaves(), p.b - b_.leaves()}; }

  // Starts `cut` with the entries before `i`, which stay.
  void differ(const NodePair* entry, int i) {
    if (!differs) cut.assign(entry, entry + i);
    differs = true;
  }

  void descend(NodePair p) {
    if (tests % pause == 0) look_up();
    meets(p) ? enter(p) : cut.push_back(p);
  }

  // Descends below a pair that overlaps.
  void enter(NodePair p) {
    if (both_leaves(p)) {
      cut.push_back(p);
      leaf_pairs.push_back(leaf_numbers(p));
      return;
    }
    NodePair child[4];
    const int n = children(p, child);
    for (int i = 0; i < n; ++i) descend(child[i]);
  }

  // The parent of a pair, with the parent of the deeper node, or of both nodes at equal depth.
  NodePair parent(NodePair p) const {
    const int gap = depth(p.a) - depth(p.b);
    return {gap >= 0 ? p.a / 2 : p.a, gap <= 0 ? p.b / 2 : p.b};
  }

  // The number of next entries if they are all children of one pair, and neither they nor the pair
  // overlap; else 0.
  int apart_siblings(const NodePair* entry, const bool* meet, int n) {
    const NodePair up = parent(*entry);
    // First children have even numbers, so an odd one cannot start a run of siblings.
    if (up.a == 0 || up.b == 0 || (2 * up.a == entry->a - 1) || (2 * up.b == entry->b - 1))
      return 0;
    NodePair child[4];
    const int row = children(up, child);
    if (row > n) return 0;
    for (int i = 0; i < row; ++i)
      if (meet[i] || entry[i].a != child[i].a || entry[i].b != child[i].b) return 0;
    return row > 0 && !meets(up) ? row : 0;
  }

  // Checks for Ctrl-C, and whether all chunks together exceed the limit.
  void look_up() {
    geometry::poll_interrupt();
    total_.add(cut.size() - counted_);
    counted_ = cut.size();
  }

  static void fetch(const FeatureTree& tree, std::int32_t node) {
    const char* at = static_cast<const char*>(tree.node(node));
    for (std::size_t i = 0; i < tree.node_bytes(); i += 64) __builtin_prefetch(at + i);
  }

  const FeatureTree &a_, &b_;
  bool self_;
  NodeTest test_;
  Total& total_;
  std::size_t counted_ = 0;
};

}  // namespace

const std::vector<NodePair>& Front::update(const FeatureTree& a, const FeatureTree& b, int threads,
                                           std::size_t limit) {
  Total total{limit};
  const std::size_t step = cut_.empty() ? root_grain : kept_grain;
  if (cut_.empty()) {
    // Splits every entry, without testing volumes, down to `first_depth` or to leaves.
    const Walk walk(a, b, total);
    cut_.push_back({1, 1});
    for (int level = 0; level < first_depth; ++level) {
      std::vector<NodePair> next;
      for (const auto p : cut_) {
        NodePair child[4];
        if (a.is_leaf(p.a) && b.is_leaf(p.b)) {
          next.push_back(p);
          continue;
        }
        const int n = walk.children(p, child);
        next.insert(next.end(), child, child + n);
      }
      cut_.swap(next);
    }
  }
  std::vector<Walk> walks((cut_.size() + step - 1) / step, Walk(a, b, total));
  geometry::interruptible_for(cut_.size(), threads, step, [&](auto begin, auto end, auto c) {
    walks[c].move(cut_.data() + begin, static_cast<int>(end - begin));
  });
  leaf_pairs_.clear();
  tests_ = 0;
  bool differs = false;
  for (const auto& w : walks) {
    leaf_pairs_.insert(leaf_pairs_.end(), w.leaf_pairs.begin(), w.leaf_pairs.end());
    tests_ += w.tests;
    differs |= w.differs;
  }
  if (!differs) return leaf_pairs_;
  std::vector<NodePair> cut;
  for (std::size_t c = 0; c < walks.size(); ++c) {
    const auto begin = cut_.begin() + c * step;
    const auto& moved = walks[c].cut;
    if (walks[c].differs) {
      cut.insert(cut.end(), moved.begin(), moved.end());
    } else {
      cut.insert(cut.end(), begin, begin + std::min(step, cut_.size() - c * step));
    }
  }
  cut_.swap(cut);
  return leaf_pairs_;
}

}  // namespace tauguard::cloth
