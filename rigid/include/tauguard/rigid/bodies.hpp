// Batches of convex bodies in the form that the kernels read, and their exact vertices.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tauguard/geometry/dyadic.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::rigid {

using geometry::Dyadic;
using geometry::Vec3;
using geometry::Vector3;

// The first three and hulls are polytopes, whose queries are exact. The kernel of support functions
// (support_shape.hpp) takes every kind but polygons.
enum class Kind : int {
  tetrahedra = 0,
  boxes = 1,
  parallelepipeds = 2,
  hulls = 3,
  polygons = 4,
  half_spaces = 5,
  points = 6,
  segments = 7,
  ellipsoids = 8,
  cylinders = 9,
  cones = 10,
};

inline bool is_polytope(Kind kind) { return kind <= Kind::hulls; }

// Whether bodies of this kind may differ in the number of vertices.
inline bool is_cloud(Kind kind) { return kind == Kind::hulls || kind == Kind::polygons; }

// A tetrahedron is a row of 12 doubles (vertices), a box of 15 (centre, half extents, rotation by
// rows), a parallelepiped of 12 (origin, edges), a half-space of 4 (normal, offset). Ellipsoids,
// cylinders and cones have rows as boxes, with three sizes instead of the half extents. Hulls and
// polygons have one array of vertices for all bodies; body i has the vertices offsets[i] to
// offsets[i + 1] - 1. Points and segments occur in Shape only.
struct Bodies {
  Kind kind;
  const double* data;
  const std::int64_t* offsets;  // hulls and polygons only
  std::size_t count;            // a single body is paired with each body of the other side

  static constexpr std::size_t strides[] = {12, 15, 12, 3, 2, 4, 0, 0, 15, 15, 15};

  std::size_t index(std::size_t row) const { return count == 1 ? 0 : row; }
  const double* row(std::size_t r) const {
    const std::size_t i = index(r);
    return data + strides[static_cast<int>(kind)] *
                      (is_cloud(kind) ? static_cast<std::size_t>(offsets[i]) : i);
  }
  std::size_t vertex_count(std::size_t r) const {
    if (kind == Kind::tetrahedra) return 4;
    if (!is_cloud(kind)) return 8;
    const std::size_t i = index(r);
    return static_cast<std::size_t>(offsets[i + 1] - offsets[i]);
  }
};

// The body of row r as a batch of one; `offsets` is its memory.
inline Bodies row_of(const Bodies& b, std::size_t r, std::int64_t* offsets) {
  offsets[0] = 0, offsets[1] = static_cast<std::int64_t>(b.vertex_count(r));
  return {b.kind, b.row(r), offsets, 1};
}

template <class Number>
using Points = std::vector<Vector3<Number>>;

// The vertices of the body of row r in `Number` arithmetic: exact with Dyadic, rounded with double.
// Of an ellipsoid, cylinder or cone: the corners of a box around it.
template <class Number>
Points<Number> vertices_of(const Bodies& bodies, std::size_t r) {
  const double* p = bodies.row(r);
  Points<Number> out(bodies.vertex_count(r));
  if (bodies.kind == Kind::polygons) {  // in the plane z = 0
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] = {Number(p[2 * i]), Number(p[2 * i + 1]), Number(0.0)};
    return out;
  }
  if (bodies.kind == Kind::tetrahedra || bodies.kind == Kind::hulls) {
    for (std::size_t i = 0; i < out.size(); ++i)
      for (int k = 0; k < 3; ++k) out[i][k] = Number(p[3 * i + k]);
    return out;
  }
  const bool box = bodies.kind != Kind::parallelepipeds;
  double half[3] = {p[3], p[4], p[5]};
  if (bodies.kind == Kind::cylinders || bodies.kind == Kind::cones) half[1] = p[3], half[2] = p[4];
  for (int k = 0; k < 3; ++k) {
    const Number origin(p[k]);
    Number g[3];
    for (int axis = 0; axis < 3; ++axis)
      g[axis] =
          box ? Number(p[6 + 3 * k + axis]) * Number(half[axis]) : Number(p[3 + 3 * axis + k]);
    for (int corner = 0; corner < 8; ++corner) {
      Number x = origin;
      for (int axis = 0; axis < 3; ++axis) {
        if (corner >> axis & 1)
          x += g[axis];
        else if (box)
          x -= g[axis];
      }
      out[static_cast<std::size_t>(corner)][k] = x;
    }
  }
  return out;
}

// A box or parallelepiped: all points origin + shift + sum_k w_k g_k with |w_k| <= 1. The centre is
// kept as origin + shift, so that a large origin costs no accuracy. The errors of g and of each
// entry of shift are at most 3 u times the edges that they are computed from.
struct Zonotope {
  double origin[3], shift[3], g[3][3];
};

inline __attribute__((always_inline)) Zonotope zonotope_of(Kind kind, const double* p) {
  Zonotope z;
  for (int k = 0; k < 3; ++k) z.origin[k] = p[k];
  if (kind == Kind::boxes) {
    for (int k = 0; k < 3; ++k) z.shift[k] = 0.0;
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 3; ++k) z.g[axis][k] = p[6 + 3 * k + axis] * p[3 + axis];
  } else {
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < 3; ++k) z.g[axis][k] = 0.5 * p[3 + 3 * axis + k];
    for (int k = 0; k < 3; ++k) z.shift[k] = z.g[0][k] + z.g[1][k] + z.g[2][k];
  }
  return z;
}

}  // namespace tauguard::rigid
