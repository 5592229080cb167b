// The first contact of two moving convex bodies, with its point and normal.
#pragma once

#include "tauguard/rigid/first_contact.hpp"

namespace tauguard::rigid {

// The time of impact (inf if there is none), and at that time a common point and the normal from a
// to b (NaN if undefined).
struct FirstTouch {
  double toi, point[3], normal[3];
};
inline constexpr FirstTouch no_touch = {INFINITY, {NAN, NAN, NAN}, {NAN, NAN, NAN}};

// Point and normal of an impact. The normal is undefined if the bodies overlap from the start. The
// point comes from the features that touch along the normal, or from the nearest points.
FirstTouch first_touch(const Impact& impact, MovingBody& a, MovingBody& b, const Vec3& origin);

// The first touch of the bodies of row `row`, each grown by a ball of the given radius.
FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row, double rounding_a,
                         double rounding_b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b);

}  // namespace tauguard::rigid
