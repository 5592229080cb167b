// Oriented boxes of a node's eight children, in float (Gottschalk, Lin and Manocha 1996). They are
// stored side by side, so that one vector instruction handles all eight. Each box has its own axes.
#pragma once

#include "mesh_traverse.hpp"

namespace tauguard::rigid {

// One child's box, relative to the centre of its tree. The rows of `axis` are its directions.
struct FloatObb {
  float axis[3][3], centre[3], extent[3];
  float size() const { return extent[0] + extent[1] + extent[2]; }
};

struct alignas(32) ObbNode {
  float axis[3][3][width];  // zero where there is no child
  float centre[3][width];
  float extent[3][width];  // -inf where there is no child
  FloatObb operator[](int slot) const;
  void set(int slot, const FloatObb& box);
};

struct ObbTree {
  std::vector<ObbNode> nodes;  // one per node of the tree
  FloatObb root;               // the whole mesh
  FloatObb box(const Slot& s) const { return s.node < 0 ? root : nodes[s.node][s.slot]; }
  float size(const Slot& s) const {
    if (s.node < 0) return root.size();
    const auto& e = nodes[s.node].extent;
    return e[0][s.slot] + e[1][s.slot] + e[2][s.slot];
  }
};

// The axes of a box are principal axes of the second moments of the surface in it. The moments are
// summed from the leaves up. A leaf has axes along its normal and longest edge instead. A box
// contains all corners of its triangles.
ObbTree fit_obbs(const Tree& tree);

// Sets bit s if child s of `node` may meet `box`, which is in the node's frame.
unsigned overlap_mask(const ObbNode& node, const FloatObb& box, float pad, float* distance2);

// `box` in another frame; `at` is the relative pose.
FloatObb placed(const FloatObb& box, const Relative& at);

struct ObbBounds {
  const ObbTree &a, &b;
  const Placement& at;
  unsigned open_a(std::int32_t node, const Slot& b_slot, float* key) const {
    return overlap_mask(a.nodes[node], placed(b.box(b_slot), at.b_in_a), at.b_in_a.pad, key);
  }
  unsigned open_b(std::int32_t node, const Slot& a_slot, float* key) const {
    return overlap_mask(b.nodes[node], placed(a.box(a_slot), at.a_in_b), at.a_in_b.pad, key);
  }
  bool a_is_larger(const Slot& a_slot, const Slot& b_slot) const {
    return a.size(a_slot) >= b.size(b_slot);
  }
};

}  // namespace tauguard::rigid
