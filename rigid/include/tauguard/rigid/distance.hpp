// Distance or penetration depth of two convex bodies at one instant, in floating point. For support
// shapes (cores grown by a radius) the result is a pair of bounds.
#pragma once

#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::rigid {

// A convex hull, given by its points.
using PointList = std::vector<Vec3>;

// The nearest points of two hulls, or a common point if they meet. `corner` lists `size` pairs of
// vertices (row of a, row of b), whose differences span the nearest feature of b - a. A `size` of 4
// means that the hulls meet.
struct Nearest {
  Vec3 a, b;
  int size;
  std::array<std::array<std::size_t, 2>, 4> corner;
};
Nearest nearest(const PointList& a, const PointList& b);

// Writes the unit direction from a to b along which the hulls are furthest apart, and the
// separation along it. Returns false if the hulls meet.
bool separating_direction(const PointList& a, const PointList& b, Vec3* n, double* separation);

struct Distance {
  double lower = -INFINITY;  // certified separation of the cores along n; negative: may overlap
  double upper = INFINITY;   // length of the segment from on_a to on_b
  Vec3 n{};                  // unit, from a to b
  Vec3 on_a{}, on_b{};       // points of the cores
  bool overlap = false;      // the cores share a point, up to rounding
};

// Distance of the cores at the present time of both shapes. `guess`: the first search direction.
// The search ends early if upper - lower < 0.1 (lower - needed).
Distance distance_of(const SupportShape& a, const SupportShape& b, const Vec3& guess,
                     double needed);

// Replaces the fields of an overlapping `d`. `lower` becomes minus the penetration depth of the
// cores, and `n` the direction of the shortest translation that separates b from a. Both points
// become the middle of the overlap along `n`. The search ends when the depth is known to
// `resolution` times the size, or when the polytope has `most_faces`.
void penetration(const SupportShape& a, const SupportShape& b, Distance* d,
                 double resolution = 1e-7, int most_faces = 396);

}  // namespace tauguard::rigid
