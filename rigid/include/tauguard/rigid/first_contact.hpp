// First contact of two moving convex bodies, from below.
#pragma once

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

struct Impact {
  double t;    // the bodies are certainly apart on [start, t)
  bool hit;    // false: apart on all of [start, end]
  Vec normal;  // unit, from a to b; zero where the bodies meet at `start` and no axis tells
};

// Advances from `start` as long as the bodies are further apart than rounding; the time it stops at
// is the time of impact, never late.
Impact first_contact(MovingBody& a, MovingBody& b, double start, double end);

// Bodies this close count as touching where a contact is described.
inline double contact_tolerance(const MovingBody& a, const MovingBody& b) {
  return 1e-9 * (a.radius() + b.radius()) + 0x1p-40 * (a.magnitude() + b.magnitude());
}

}  // namespace tauguard::rigid
