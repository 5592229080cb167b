// How deep two overlapping cores are in one another.
#pragma once

#include "distance.hpp"

namespace tauguard::contacts {

// Replaces the fields of an overlapping `d`: `lower` is minus the depth of the cores, `n` the
// direction in which b leaves a by the shortest way, and both points are the middle of the overlap.
void penetration(const Mover& a, const Mover& b, Distance* d);

}  // namespace tauguard::contacts
