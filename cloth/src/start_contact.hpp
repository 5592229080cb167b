// Whether two features touch at the start of the step, for example at rest on each other. Exact.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

enum class AtStart { apart, touching, unknown };

// The result is `unknown` if no coordinate is the same in all vertices and the coordinates on one
// axis span more than 116 bits. row: 4 vertices.
AtStart at_start(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
