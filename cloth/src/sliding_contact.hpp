// First contact of two features that slide on a plane perpendicular to an axis: one coordinate is
// the same in all four vertices.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// The first time of contact of features that are apart at the start, at most 2^-39 early and never
// late; infinity without contact. NaN if rounding prevents a decision, if a vertex may cross the
// line of an edge twice, or if the four vertices `row` have no common coordinate at both ends.
double sliding_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
