// The decision of exact.hpp in integers of fixed width. It is exact and some ten times faster, but
// gives no result if numbers are too long or roots too close.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// The first time of contact, at most 2^-37 early and never late; infinity without contact; NaN
// without a result. There is no result in these cases:
// * The coordinates of the query on one axis span more than 116 bits.
// * Two roots of the cubic are closer than 1/32 of the step.
// * A side of the hull has two roots in the interval around a root of the cubic.
double integer_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
