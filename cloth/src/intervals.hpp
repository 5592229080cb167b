// Decides single queries by intervals of time, if batch.hpp does not decide them or if they have a
// minimum distance.
#pragma once

#include <limits>

#include "narrow_phase.hpp"
#include "query.hpp"

namespace tauguard::cloth {

inline constexpr double undecided = std::numeric_limits<double>::quiet_NaN();

// The time of contact: the start of the first interval that is not clear, or infinity. `undecided`
// if the contact is not certain. With a minimum distance there are at most 4001 cuts, and an
// interval that is not clear by then counts as contact. Without one there are at most 41 cuts,
// because exact arithmetic is cheaper than more cuts.
double first_contact(const Query& k, bool vf, Stats& stats);

}  // namespace tauguard::cloth
