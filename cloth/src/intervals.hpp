// One query by intervals of time: for what the batch cannot decide, and for a minimum distance.
#pragma once

#include <limits>

#include "narrow_phase.hpp"
#include "query.hpp"

namespace tauguard::cloth {

inline constexpr double undecided = std::numeric_limits<double>::quiet_NaN();

// The start of the first interval that no filter clears; infinity if there is none; undecided if it
// is not certain that this is contact. At most 4001 intervals are cut with a minimum distance; what
// is left then counts as contact. Without one at most 41 are cut, since exact arithmetic is cheaper
// than more.
double first_contact(const Query& k, bool vf, Stats& stats);

}  // namespace tauguard::cloth
