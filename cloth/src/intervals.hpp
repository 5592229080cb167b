// One query by intervals of time: for what the batch cannot decide, and for a minimum distance.
#pragma once

#include <limits>

#include "narrow_phase.hpp"
#include "query.hpp"

namespace tauguard::cloth {

inline constexpr double undecided = std::numeric_limits<double>::quiet_NaN();

// The start of the first interval that no filter clears; infinity where there is none; undecided
// where it cannot be told whether that is contact. At most 4001 intervals are cut with a minimum
// distance, where what is then left counts as contact, and 41 without one: beyond that exact
// arithmetic is cheaper.
double first_contact(const Query& k, bool vf, Stats& stats);

}  // namespace tauguard::cloth
