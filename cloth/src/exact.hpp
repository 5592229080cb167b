// The reference in exact arithmetic: whether and when a query has contact, for all finite doubles.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

// The first time of contact, rounded down by at most a relative 2^-52 or an absolute 2^-60;
// infinity without contact. row: 4 vertices: vertex and face, or edge and edge.
double exact_contact(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
