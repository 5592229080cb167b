// The reference: does a query hit, and when first, in exact arithmetic. Right for all finite
// doubles.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// Infinity without a hit, else the first time of contact, rounded down (by 2^-52 of it or 2^-60).
// row: 4 vertices: vertex and face, or edge and edge.
double exact_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
