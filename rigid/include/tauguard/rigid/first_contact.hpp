// First contact of two moving convex bodies. The time is conservative: never late.
#pragma once

#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {

struct Impact {
  double t;     // the bodies are certainly apart on [start, t)
  bool hit;     // false: apart on all of [start, end]
  Vec3 normal;  // unit, from a to b; zero for an overlap at `start` if no normal is known
};

// Advances from `start` to `end` while the distance of the bodies exceeds rounding errors.
Impact first_contact(MovingBody& a, MovingBody& b, double start, double end);

// Bodies at most this far apart are described as touching.
inline double contact_tolerance(const MovingBody& a, const MovingBody& b) {
  return 1e-9 * (a.radius() + b.radius()) + 0x1p-40 * (a.magnitude() + b.magnitude());
}

// Where and when two support shapes touch.
struct Touch {
  bool hit = false;
  double t = INFINITY;     // the surfaces are further apart than `threshold` on [start, t)
  double distance = NAN;   // signed distance of the surfaces at t; negative is penetration
  Vec3 point{}, normal{};  // relative to the shapes' origin; the normal from a to b
};

// Advances from `start` to 1 while the surfaces are further apart than `threshold` >= 0. Surfaces
// closer than `touching` times the size of the shapes count as touching. A smaller value needs more
// steps; a larger one gives an earlier time.
Touch first_contact(SupportShape& a, SupportShape& b, double threshold, double start,
                    double touching = 1e-10);

// Describes the contact at the present time t of both shapes. `n` is the last direction in which
// they were apart, or zero.
Touch describe(const SupportShape& a, const SupportShape& b, const Distance& d, const Vec3& n,
               double t);

}  // namespace tauguard::rigid
