// The vertices of a hull that can be the furthest ones, by direction, and the hull at a pose.
#pragma once

#include <vector>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

// The directions are divided into the cells of a grid on the faces of a cube. A cell is the cone of
// its four corner directions c. A vertex v can be further along some direction of the cone than a
// vertex w only if (v - w) . c > 0 for one of them. The list of a cell has the vertices that pass
// this test against the furthest vertex of each corner.
class HullIndex {
 public:
  // `vertices`: `count` rows of 3, which stay alive.
  HullIndex(const double* vertices, std::size_t count);

  struct List {
    const std::uint32_t *begin, *end;
  };
  // The vertices within margin() of the furthest one along m, whose largest component counts as 1,
  // and others. Empty for a direction that is zero or not finite.
  List near(const Vec3& m) const;
  double margin() const { return 1e-9 * reach_; }

  const double* vertices() const { return vertices_; }
  std::size_t size() const { return count_; }
  double reach() const { return reach_; }    // the largest |y|
  double spread() const { return spread_; }  // the largest distance from the first vertex

 private:
  void add_face(int face);

  const double* vertices_;
  std::size_t count_;
  int side_;  // cells along an edge of the cube
  double reach_ = 0, spread_ = 0;
  std::vector<std::uint32_t> first_, rows_;  // of all cells
};

// A body of a batch at a pose (null: in place), for queries that need not place all its vertices.
struct PosedRow {
  const Bodies& bodies;
  std::size_t row;
  const double* pose;
  const HullIndex* index;  // of the vertices of a hull, or null
};

// The vertices of a hull at a pose (null: in place) relative to `origin`, computed one by one. They
// equal those of PosedBody less the origin.
class PosedHull {
 public:
  PosedHull(const HullIndex& index, const double* pose, const Vec3& origin);
  Vec3 operator[](std::size_t i) const;
  std::size_t extreme(const Vec3& n) const;
  // Adds the vertices within `tolerance` of the furthest one along n, and others near it.
  void near(const Vec3& n, double tolerance, Points<double>* out) const;
  // Bounds of the largest coordinate.
  double least_size() const;
  double most_size() const;

 private:
  Vec3 local(const Vec3& n) const;
  const HullIndex& index_;
  const double* pose_;
  Vec3 origin_;
  double rounding_;  // bound on the rounding error of n . (vertex) for a unit vector n
};
inline std::size_t extreme(const PosedHull& hull, const Vec3& n) { return hull.extreme(n); }

}  // namespace tauguard::rigid
