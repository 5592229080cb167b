// For comparison only: bounding volumes that no query uses by default (ball, oriented box, 18-DOP).
// All are in double precision, relative to their tree's centre. Tests add a pad for rounding, so
// volumes that overlap are never reported as apart.
#pragma once

#include "mesh_traverse.hpp"

namespace tauguard::rigid {

// The centred pose of tree b in tree a's frame, in double.
struct Frame {
  double r[3][3], t[3], pad;
  Frame(const Tree& a, const Tree& b, const Pose& pose);
  // Both trees are in one frame already.
  static const Frame& same() {
    static const Frame frame;
    return frame;
  }
  void apply(const double* x, double* out) const {
    for (int i = 0; i < 3; ++i) out[i] = r[i][0] * x[0] + r[i][1] * x[1] + r[i][2] * x[2] + t[i];
  }

 private:
  Frame() : r{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, t{0, 0, 0}, pad(0) {}
};

// Triangles whose corners, relative to the tree's centre, a volume must contain.
struct Cluster {
  const Triangle* begin;
  const Triangle* end;
  const double* centre;
};

struct Ball {
  double centre[3], radius;
  static Ball fit(const Cluster& c);
  using Relation = Frame;
  static bool meet(const Ball& a, const Ball& b, const Relation& at);
  double volume() const { return 4.18879020478639 * radius * radius * radius; }
};

struct Obb {
  double axis[3][3];  // rows, orthonormal up to rounding
  double centre[3], extent[3];
  static Obb fit(const Cluster& c);
  using Relation = Frame;
  static bool meet(const Obb& a, const Obb& b, const Relation& at);
  double volume() const { return 8 * extent[0] * extent[1] * extent[2]; }
};

// An 18-DOP: bounds along the first nine axes of geometry/k_dop.hpp.
struct KDop {
  static constexpr int directions = 9;
  double lo[directions], hi[directions], centre[3];
  static KDop fit(const Cluster& c);

  // A direction d as a sum of three of the 18 half-space normals with weights >= 0. By duality the
  // maximum of d.x over the polytope is at most the sum of weight * bound. The normals adjacent to
  // d give the least sum that is found without a linear program.
  struct Cone {
    int index[3];
    double weight[3];  // negative: the opposite normal with weight -weight
    static Cone around(const double* d);
  };
  struct Relation {
    Frame at;
    Cone a_from_b[directions], b_from_a[directions];
    double shift_a[directions], shift_b[directions];
    Relation(const Tree& a, const Tree& b, const Pose& pose);
  };
  static bool meet(const KDop& a, const KDop& b, const Relation& at);
};

// The volumes of every child of a tree. Entry 0: the whole mesh; 1 + 8 node + slot: a child.
template <class Volume>
std::vector<Volume> fit_all(const Tree& tree);

template <class Volume>
struct VolumeBounds {
  const Tree &a, &b;
  const std::vector<Volume>&va, &vb;
  typename Volume::Relation at;

  static std::size_t index(const Slot& s) {
    return s.node < 0 ? 0 : 1 + std::size_t(width) * s.node + s.slot;
  }

  unsigned open(bool first, std::int32_t node, const Slot& fixed, float* key) const {
    unsigned mask = 0;
    const Tree& tree = first ? a : b;
    for (int s = 0; s < width && tree.nodes[node].child[s] != no_child; ++s) {
      const Volume& x = va[index(first ? Slot{node, s} : fixed)];
      const Volume& y = vb[index(first ? fixed : Slot{node, s})];
      if (!Volume::meet(x, y, at)) continue;
      mask |= 1u << s;
      key[s] = distance2(x.centre, y.centre);
    }
    return mask;
  }
  unsigned open_a(std::int32_t node, const Slot& b_slot, float* key) const {
    return open(true, node, b_slot, key);
  }
  unsigned open_b(std::int32_t node, const Slot& a_slot, float* key) const {
    return open(false, node, a_slot, key);
  }
  bool a_is_larger(const Slot& a_slot, const Slot& b_slot) const {
    return a_slot.box(a).size() >= b_slot.box(b).size();
  }

 private:
  float distance2(const double* x, const double* y) const {
    double moved[3], sum = 0;
    frame(at).apply(y, moved);
    for (int k = 0; k < 3; ++k) sum += (moved[k] - x[k]) * (moved[k] - x[k]);
    return static_cast<float>(sum);
  }
  static const Frame& frame(const Frame& f) { return f; }
  static const Frame& frame(const KDop::Relation& r) { return r.at; }
};

}  // namespace tauguard::rigid
