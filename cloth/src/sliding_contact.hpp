// First contact of two features that slide on one plane: one coordinate is the same in all four
// vertices.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// For features that are apart at the start. The first time of contact, at most 2^-39 early and
// never late; infinity without a contact. NaN if rounding hides it, if a vertex may cross the line
// of an edge twice, or if no coordinate is the same in all vertices at both ends. row: 4 vertices.
double sliding_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
