// Decides like exact.hpp, in integers of fixed width. It is exact and some ten times faster, but
// gives no answer if numbers are too long or roots too close.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// The first time of contact, at most 2^-37 early and never late; infinity without a hit; NaN
// without an answer. There is no answer if the coordinates of a query on one axis span more than
// 116 bits, if roots are closer than 1/32 of the step to each other, or if a side of the hull has
// two roots next to that root.
double integer_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
