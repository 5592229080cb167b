// Distance or penetration depth of two convex bodies at one instant: rounded, with lower and upper
// bounds for support shapes.
#pragma once

#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::rigid {

// Points that stand for their convex hull.
using PointList = std::vector<Vec3>;

// The nearest points of two hulls, or a common point if they meet. `corner` holds the vertices
// (rows of a and of b) that span the features of these points. Four pairs mean that the hulls meet.
struct Nearest {
  Vec3 a, b;
  int size;
  std::array<std::array<std::size_t, 2>, 4> corner;
};
Nearest nearest(const PointList& a, const PointList& b);

// A common point of the hulls if they meet, otherwise the middle of their nearest points.
Vec3 middle_point(const PointList& a, const PointList& b);

// The unit direction from a to b along which the hulls are furthest apart. False if they meet.
bool separating_direction(const PointList& a, const PointList& b, Vec3* n, double* separation);

struct Distance {
  double lower = -INFINITY;  // certified: the cores are this far apart along n (negative: they may
                             // overlap)
  double upper = INFINITY;   // the length of a segment between both cores
  Vec3 n{};                  // unit, from a to b
  Vec3 on_a{}, on_b{};       // the ends of that segment
  bool overlap = false;      // the cores share a point, to rounding
};

// Distance of the cores at the present time of both shapes. `guess` is the first direction. The
// search ends early if `lower` exceeds `needed` and is within a tenth of the true distance above
// it.
Distance distance_of(const SupportShape& a, const SupportShape& b, const Vec3& guess,
                     double needed);

// Replaces the fields of an overlapping `d`: `lower` is minus the penetration depth of the cores,
// `n` the direction in which b leaves a by the shortest path, and both points are the middle of the
// overlap.
void penetration(const SupportShape& a, const SupportShape& b, Distance* d);

}  // namespace tauguard::rigid
