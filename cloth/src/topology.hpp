// What a list of faces implies: the vertices in use, the unique edges, and what changed since
// another list.
#pragma once

#include <cstdint>
#include <vector>

#include "feature_tree.hpp"

namespace tauguard::cloth {

// A loose edge stands among the faces as (a, b, b), a loose point as (p, p, p), after all
// triangles: vertex and face then is point and edge, or point and point.
struct Topology {
  Features vertices{1, {}}, edges{2, {}}, faces{3, {}};
  // Positions must have at least so many rows.
  std::size_t rows() const {
    return vertices.vertices.empty() ? 0 : std::size_t(vertices.vertices.back()) + 1;
  }
  std::size_t triangles = 0;
  // faces: rows of three different vertices, then the loose ones. Edges: rows (smaller, larger) in
  // lexicographic order.
  void set(std::vector<std::int32_t> face_vertices);
};

// Of vertices 0 to n - 1: 1 for the loose points.
std::vector<std::uint8_t> loose_points(const Topology& topology, std::size_t n);

// For every old feature the number of the equal new one, or -1. Rows must be sorted and unique.
std::vector<std::int32_t> match_sorted(const Features& before, const Features& after);
// The same for faces: equal rows match in order of appearance.
std::vector<std::int32_t> match_faces(const Features& before, const Features& after);

}  // namespace tauguard::cloth
