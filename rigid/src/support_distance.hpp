// Signed distance of two convex bodies of which at least one is curved or a half-space.
#pragma once

#include "signed_distance.hpp"

namespace tauguard::rigid {

// The distance lies between two bounds that differ by at most 1e-9 of the size, which is the
// largest extent or distance of the middles; support_distance.cpp tells when that is certified.
SignedDistance support_distance(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                                double radius_b);

// A point of both bodies, which overlap.
Vec3 support_common_point(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                          double radius_b);

}  // namespace tauguard::rigid
