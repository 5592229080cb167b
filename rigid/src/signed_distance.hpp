// Signed distance of two convex bodies, row by row.
#pragma once

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// distance = (point_b - point_a) . normal: apart it is the shortest way between the bodies, in each
// other it is minus the shortest way that brings them apart, along the normal (unit, from a to b).
struct SignedDistance {
  double distance;
  Vec point_a, point_b, normal;
};

// Of row `row`, each body grown by a ball of the given radius. The sign is exact for what the
// numbers say; the length is off by 2^-45 of the bodies' extent and distance at most.
SignedDistance signed_distance(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                               double radius_b);

// Do the bodies of row `row`, grown so, share a point? Exact, touching counts.
bool meet(const Bodies& a, const Bodies& b, std::size_t row, double radius_a, double radius_b);

}  // namespace tauguard::rigid
