// The decision of exact.hpp in integers of fixed width: some ten times faster, and exact too, but
// silent where numbers are too long or roots too close for it.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// Infinity without a hit; the first time of contact, at most 2^-37 early and never late; NaN where
// it is silent: where the coordinates of a query on one axis span more than 116 bits, where roots
// are closer than 1/32 of the step to one another, and where a side has two roots, or one of a few
// even times, next to that root.
double integer_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
