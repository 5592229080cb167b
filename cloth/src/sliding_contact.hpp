// When do two features touch that slide on one plane, a coordinate the same in all four vertices?
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// For features that are apart at the start. Infinity without a contact; the first time of contact,
// at most 2^-39 early and never late; NaN where rounding hides it, where a vertex may cross an
// edge's line twice, or where no coordinate is the same in all at both ends. row: 4 vertices.
double sliding_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
