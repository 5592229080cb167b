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

// The nearest points of both hulls, of a and of b; one common point where they meet.
std::array<Vec, 2> nearest_points(const std::vector<Vec>& a, const std::vector<Vec>& b);

}  // namespace tauguard::rigid
