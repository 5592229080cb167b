// A tree over the triangles of one rigid mesh. A node has eight children; each is an inner node, a
// leaf of a few triangles, or empty. Their boxes are stored side by side in float, so that one
// vector instruction tests all eight. Boxes are relative to the tree's centre and rounded outward.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <vector>

#include "mesh_triangles.hpp"
#include "tauguard/geometry/aabb.hpp"

namespace tauguard::rigid {

inline constexpr int width = 8;       // children of a node: one AVX register of floats
inline constexpr int leaf_size = 4;   // largest number of triangles in a leaf
inline constexpr int small_leaf = 2;  // a range of at most this many triangles is not split

// A child: an inner node (>= 0), or ~(8 first + count) for a leaf with the triangles
// [first, first + count).
using Child = std::int32_t;
inline constexpr Child no_child = std::numeric_limits<Child>::min();
inline bool is_leaf(Child c) { return c < 0; }
inline int leaf_first(Child c) { return ~c >> 3; }
inline int leaf_count(Child c) { return ~c & 7; }

struct alignas(32) Node {
  float centre[3][width];
  float extent[3][width];  // half the edge, -inf if there is no child
  Child child[width];
};

// One child's box.
struct Box {
  float centre[3], extent[3];
  float size() const { return extent[0] + extent[1] + extent[2]; }
};

inline Box box_of(const Node& n, int slot) {
  return {{n.centre[0][slot], n.centre[1][slot], n.centre[2][slot]},
          {n.extent[0][slot], n.extent[1][slot], n.extent[2][slot]}};
}

// A float box around [lo, hi], rounded outward.
inline Box outward(const double* lo, const double* hi) {
  Box b;
  for (int k = 0; k < 3; ++k) {
    b.centre[k] = static_cast<float>(lo[k] + 0.5 * (hi[k] - lo[k]));
    const double half = std::max(hi[k] - b.centre[k], b.centre[k] - lo[k]);
    b.extent[k] = std::nextafter(std::nextafter(static_cast<float>(half), INFINITY), INFINITY);
  }
  return b;
}

class Tree {
 public:
  // vertices: (n, 3); faces: (n_faces, 3), at least one. The caller has checked both.
  Tree(const double* vertices, const std::int32_t* faces, std::size_t n_faces);

  std::vector<Node> nodes;          // nodes[0] is the root
  std::vector<Triangle> triangles;  // in leaf order, as given (not relative to the centre)
  std::vector<std::int32_t> id;     // row of `faces` for each of `triangles`
  double centre[3];
  double radius;     // of a ball about `centre` that contains the mesh, rounded up
  double magnitude;  // the largest |coordinate| of the mesh
  Box root;          // the whole mesh, relative to the centre

 private:
  struct alignas(16)
      Item {  // a triangle during the build: its box relative to the centre, and its row
    float lo[3];
    std::int32_t row;
    float hi[3], unused;
    float middle(int k) const { return lo[k] + hi[k]; }  // twice the centre
  };
  struct Range {
    std::int32_t begin, end;
    std::int32_t count() const { return end - begin; }
  };

  std::int32_t build(Range all);
  std::int32_t split(Range r);

  std::vector<Item> items_;
};

}  // namespace tauguard::rigid
