// The decision of exact.hpp in integers of fixed width: exact and some ten times faster, but it
// gives no answer if numbers are too long or roots too close.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// Infinity without a hit; the first time of contact, at most 2^-37 early and never late; NaN
// without an answer. This happens if the coordinates of a query on one axis span more than 116
// bits, if roots are closer than 1/32 of the step to each other, or if a side has two roots, or one
// at a few even times, next to that root.
double integer_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
