// The vertices and unique edges of a list of faces, and the changes since another list.
#pragma once

#include <cstdint>
#include <vector>

#include "feature_tree.hpp"

namespace tauguard::cloth {

// An isolated edge belongs to no face, an isolated vertex to no face and no edge. They follow the
// triangles in `faces`, as degenerate faces (a, b, b) and (p, p, p). A vertex-face query with such
// a row tests a point against an edge, or against a point.
struct Topology {
  Features vertices{1, {}}, edges{2, {}}, faces{3, {}};
  // The least number of rows that positions must have.
  std::size_t rows() const {
    return vertices.vertices.empty() ? 0 : std::size_t(vertices.vertices.back()) + 1;
  }
  std::size_t triangles = 0;
  // faces: rows of three different vertices, then isolated edges and vertices. Edges: rows
  // (smaller, larger) in lexicographic order.
  void set(std::vector<std::int32_t> face_vertices);
};

// 1 for each isolated vertex, 0 for the others. Shape (n).
std::vector<std::uint8_t> isolated_vertices(const Topology& topology, std::size_t n);

// For every old feature, the number of the equal new one, or -1. Rows must be sorted and unique.
std::vector<std::int32_t> match_sorted(const Features& before, const Features& after);
// The same for faces: equal rows match in order of appearance.
std::vector<std::int32_t> match_faces(const Features& before, const Features& after);

}  // namespace tauguard::cloth
