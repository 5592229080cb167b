// Up to four contact points of two convex bodies that touch, overlap or are near each other.
#pragma once

#include "signed_distance.hpp"

namespace tauguard::rigid {

struct Manifold {
  static constexpr int most = 4;
  int count = 0;
  Vec3 on_a[most], on_b[most];
  double distance[most];  // along the normal; negative in penetration
};

// Contacts at most `margin` apart along the normal of `g`, the signed distance of row `row`. The
// contact features are the faces (edges, vertices) that are flat across the normal up to 3 degrees;
// the points are corners of the intersection of both features seen along the normal. The least
// distance is that of `g`.
Manifold manifold_of(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                     double radius_b, double margin, const SignedDistance& g);

}  // namespace tauguard::rigid
