// First contact of two moving convex shapes, from below.
#pragma once

#include "distance.hpp"

namespace tauguard::contacts {

struct Touch {
  bool hit = false;
  double t = INFINITY;    // the shapes are further apart than the threshold on [start, t)
  double distance = NAN;  // between both surfaces at t, negative in penetration
  Vec point{}, normal{};  // relative to the movers' origin; the normal from a to b
};

// Advances from `start` to 1 while the surfaces are further apart than `threshold` >= 0. Shapes
// closer than the share `touching` of their size touch: smaller costs steps, larger is early by as
// much.
Touch first_touch(Mover& a, Mover& b, double threshold, double start, double touching = 1e-10);

// What is touched at the movers' present time t; `n` is the last direction in which they were
// apart, or zero.
Touch describe(const Mover& a, const Mover& b, const Distance& d, const Vec& n, double t);

}  // namespace tauguard::contacts
