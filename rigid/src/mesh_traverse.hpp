// The traversal of two trees that all overlap queries use. It is depth first, opens the larger of
// two boxes, and visits the child with the nearest centre first.
#pragma once

#include <vector>

#include "mesh_boxes.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {

// A child of a tree, identified by node and slot. Node -1 means the whole tree.
struct Slot {
  std::int32_t node, slot;
  Child child(const Tree& t) const { return node < 0 ? 0 : t.nodes[node].child[slot]; }
  Box box(const Tree& t) const { return node < 0 ? t.root : box_of(t.nodes[node], slot); }
};

struct SlotPair {
  Slot a, b;
};

// Boxes of the default trees; see comparison_volumes.hpp for the others.
struct BoxBounds {
  const Tree &a, &b;
  const Placement& at;
  unsigned open_a(std::int32_t node, const Slot& b_slot, float* key) const {
    return overlap_mask(a.nodes[node], b_slot.box(b), at.b_in_a, key);
  }
  unsigned open_b(std::int32_t node, const Slot& a_slot, float* key) const {
    return overlap_mask(b.nodes[node], a_slot.box(a), at.a_in_b, key);
  }
  bool a_is_larger(const Slot& a_slot, const Slot& b_slot) const {
    return a_slot.box(a).size() >= b_slot.box(b).size();
  }
};

// Calls leaf(child of a, child of b), until it returns true, for every pair of leaves whose bounds
// may meet. Returns whether a call returned true. `stack` is scratch space, kept between calls.
template <class Bounds, class Leaf>
bool traverse(const Tree& a, const Tree& b, const Bounds& bounds, std::vector<SlotPair>& stack,
              Leaf leaf) {
  stack.clear();
  stack.push_back({{-1, 0}, {-1, 0}});
  float key[width];
  while (!stack.empty()) {
    geometry::poll_interrupt();
    const SlotPair pair = stack.back();
    stack.pop_back();
    const Child ca = pair.a.child(a), cb = pair.b.child(b);
    if (is_leaf(ca) && is_leaf(cb)) {
      if (leaf(ca, cb)) return true;
      continue;
    }
    const bool open_a = is_leaf(cb) || (!is_leaf(ca) && bounds.a_is_larger(pair.a, pair.b));
    unsigned mask = open_a ? bounds.open_a(ca, pair.b, key) : bounds.open_b(cb, pair.a, key);
    const std::size_t base = stack.size();
    for (; mask; mask &= mask - 1) {
      const int s = __builtin_ctz(mask);
      const SlotPair next = open_a ? SlotPair{{ca, s}, pair.b} : SlotPair{pair.a, {cb, s}};
      stack.push_back(next);
    }
    // Insertion sort, with the nearest on top of the stack.
    const auto distance = [&](const SlotPair& p) { return key[open_a ? p.a.slot : p.b.slot]; };
    for (std::size_t i = base + 1; i < stack.size(); ++i)
      for (std::size_t j = i; j > base && distance(stack[j]) > distance(stack[j - 1]); --j)
        std::swap(stack[j], stack[j - 1]);
  }
  return false;
}

}  // namespace tauguard::rigid
