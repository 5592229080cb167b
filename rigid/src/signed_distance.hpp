// Signed distance of two convex bodies, row by row.
#pragma once

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// distance = (point_b - point_a) . normal: for bodies that are apart it is the length of the
// shortest segment between them, for overlapping ones minus the length of the shortest translation
// that separates them, along the normal (unit, from a to b).
struct SignedDistance {
  double distance;
  Vec3 point_a, point_b, normal;
};

// Of row `row`, each body grown by a ball of the given radius. The sign is exact for the given
// numbers; the error of the length is at most 2^-45 of the bodies' extent and distance.
SignedDistance signed_distance(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                               double radius_b);

// Do the bodies of row `row`, grown so, share a point? Exact, touching counts.
bool meet(const Bodies& a, const Bodies& b, std::size_t row, double radius_a, double radius_b);

}  // namespace tauguard::rigid
