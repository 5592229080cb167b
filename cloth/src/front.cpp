#include "front.hpp"

#include <algorithm>
#include <atomic>

#include "tauguard/geometry/interrupt.hpp"
#include "too_many.hpp"

namespace tauguard::cloth {
namespace {

// Front entries of a chunk: a kept entry is about one test, one near the root a whole descent.
constexpr std::size_t kept_grain = 1024, root_grain = 16;
constexpr int first_depth = 5;  // the cut to start from: all pairs at this depth

int depth(std::int32_t node) { return 31 - __builtin_clz(static_cast<unsigned>(node)); }

// Entries of the new cut so far, of all chunks.
struct Total {
  std::size_t limit;
  std::atomic<std::size_t> entries{0};
  void add(std::size_t more) {
    if ((entries += more) > limit) throw TooMany("pairs of leaves (8 times limit)", limit);
  }
};

// One chunk's walk: reads a run of the old cut, writes its part of the new one.
class Walk {
 public:
  Walk(const FeatureTree& a, const FeatureTree& b, Total& total)
      : a_(a), b_(b), self_(&a == &b), test_(node_test(a.slots(), a.times())), total_(total) {}

  bool overlap(NodePair p) {
    if (++tests % pause == 0) look_up();
    return a_.may_meet(p.a, b_, p.b) && test_(a_.node(p.a), b_.node(p.b));
  }

  void descend(NodePair p) {
    if (overlap(p)) {
      enter(p);
    } else {
      cut.push_back(p);
    }
  }

  // Below a pair that overlaps.
  void enter(NodePair p) {
    if (a_.is_leaf(p.a) && b_.is_leaf(p.b)) {
      cut.push_back(p);
      leaf_pairs.push_back({p.a - a_.leaves(), p.b - b_.leaves()});
      return;
    }
    NodePair child[4];
    const int n = children(p, child);
    for (int i = 0; i < n; ++i) descend(child[i]);
  }

  // At one depth both sides split, else the deeper one: the other is a leaf.
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

  // The deeper side came from a split; at one depth both did.
  NodePair parent(NodePair p) const {
    const int gap = depth(p.a) - depth(p.b);
    return {gap >= 0 ? p.a / 2 : p.a, gap <= 0 ? p.b / 2 : p.b};
  }

  // Entries [begin, end) of the old cut. Where all children of a pair stand in a row and the pair
  // itself is apart, it takes their place.
  void move(const NodePair* begin, const NodePair* end) {
    while (begin < end) {
      // Nodes lie anywhere in memory: what is looked at some entries later is asked for now.
      const NodePair& later = begin[std::min<std::ptrdiff_t>(ahead, end - begin - 1)];
      fetch(a_, later.a);
      fetch(b_, later.b);
      NodePair child[4];
      const NodePair up = parent(*begin);
      const int n = up.a > 0 && up.b > 0 ? children(up, child) : 0;
      if (n == 0 || end - begin < n || !same(begin, child, n)) {
        descend(*begin++);
        continue;
      }
      bool overlaps[4], any = false;
      for (int i = 0; i < n; ++i) any |= overlaps[i] = overlap(begin[i]);
      if (!any && !overlap(up)) {
        cut.push_back(up);
      } else {
        for (int i = 0; i < n; ++i) overlaps[i] ? enter(begin[i]) : cut.push_back(begin[i]);
      }
      begin += n;
    }
  }

  // Ctrl-C, and the size that all walks together have reached.
  void look_up() {
    geometry::poll_interrupt();
    total_.add(cut.size() - counted_);
    counted_ = cut.size();
  }

  std::vector<NodePair> cut, leaf_pairs;
  std::size_t tests = 0;

 private:
  static constexpr std::size_t pause = 1024;  // tests between two looks

  static bool same(const NodePair* x, const NodePair* y, int n) {
    for (int i = 0; i < n; ++i)
      if (x[i].a != y[i].a || x[i].b != y[i].b) return false;
    return true;
  }

  const FeatureTree &a_, &b_;
  static constexpr std::ptrdiff_t ahead = 8;
  static void fetch(const FeatureTree& tree, std::int32_t node) {
    constexpr int line = 16;  // floats
    const float* at = tree.node(node);
    for (int i = 0; i < 2 * tree.slots() * tree.times(); i += line) __builtin_prefetch(at + i);
  }

  bool self_;
  NodeTest test_;
  Total& total_;
  std::size_t counted_ = 0;
};

void append(std::vector<NodePair>& to, const std::vector<NodePair>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

}  // namespace

const std::vector<NodePair>& Front::update(const FeatureTree& a, const FeatureTree& b, int threads,
                                           std::size_t limit) {
  Total total{limit};
  const std::size_t step = cut_.empty() ? root_grain : kept_grain;
  if (cut_.empty()) {
    // Split every entry, without looking at the volumes, until it is `first_depth` deep or two
    // leaves.
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
    walks[c].move(cut_.data() + begin, cut_.data() + end);
  });
  cut_.clear();
  leaf_pairs_.clear();
  tests_ = 0;
  for (const auto& w : walks) {
    append(cut_, w.cut);
    append(leaf_pairs_, w.leaf_pairs);
    tests_ += w.tests;
  }
  return leaf_pairs_;
}

}  // namespace tauguard::cloth
