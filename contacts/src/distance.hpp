// The distance of two convex cores at one instant, from both sides.
#pragma once

#include "shapes.hpp"

namespace tauguard::contacts {

struct Distance {
  double lower =
      -INFINITY;  // certified: the cores are this far apart along n (negative: they may overlap)
  double upper = INFINITY;  // the length of a segment between both cores
  Vec n{};                  // unit, from a to b
  Vec on_a{}, on_b{};       // the ends of that segment
  bool overlap = false;     // the cores share a point, to rounding
  Vec simplex[4];           // the last vertices of b - a, for the penetration
  int corners = 0;
};

// Gilbert, Johnson and Keerthi 1988 on b - a at the movers' present time. `guess` is tried first as
// a direction. Stops early once `lower` exceeds `needed` and lies within a tenth of what is left
// above it.
Distance distance_of(const Mover& a, const Mover& b, const Vec& guess, double needed);

}  // namespace tauguard::contacts
