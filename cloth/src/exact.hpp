// The reference in exact arithmetic: whether a query hits, and when first. It is right for all
// finite doubles.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// The first time of contact, rounded down (by 2^-52 of it or 2^-60); infinity without a hit. row: 4
// vertices: vertex and face, or edge and edge.
double exact_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
