// Signed distance of two convex bodies, row by row.
#pragma once

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// distance = (point_b - point_a) . normal, with a unit normal from a to b. If the bodies are apart,
// the distance is the length of the shortest segment between them. If they overlap, it is minus the
// length of the shortest translation that separates them, which is along the normal.
struct SignedDistance {
  double distance;
  Vec3 point_a, point_b, normal;
};

// The signed distance of row `row`, with each body grown by a ball of the given radius. For other
// bodies than polytopes it is that of support_distance.hpp; for polytopes the sign is
// exact, and the error is at most 2^-45 times the largest coordinate relative to a point of a.
SignedDistance signed_distance(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                               double radius_b);

// The result for bodies grown by balls. If `known`, `sign` is the exact sign of the distance.
SignedDistance grown(SignedDistance g, double radius_a, double radius_b, int sign, bool known);

// Whether the grown bodies of row `row` share a point, exactly. Touching counts.
bool meet(const Bodies& a, const Bodies& b, std::size_t row, double radius_a, double radius_b);

}  // namespace tauguard::rigid
