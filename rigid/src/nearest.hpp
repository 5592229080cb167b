// Directions and points between two convex hulls of points, to rounding.
#pragma once

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// The direction (unit, from a to b) along which the sets are furthest apart; false where they meet
// to rounding.
bool separating_direction(const std::vector<Vec>& a, const std::vector<Vec>& b, Vec* n,
                          double* separation);

// A point of both hulls where they meet; the middle of their nearest points where they are apart.
Vec middle_point(const std::vector<Vec>& a, const std::vector<Vec>& b);

// The nearest points of both hulls, of a and of b, one common point where they meet; and the
// features they lie on: rows of a and of b whose differences span the nearest one. Four: they meet.
struct Nearest {
  Vec a, b;
  int size;
  std::array<std::array<std::size_t, 2>, 4> corner;
};
Nearest nearest(const std::vector<Vec>& a, const std::vector<Vec>& b);

}  // namespace tauguard::rigid
