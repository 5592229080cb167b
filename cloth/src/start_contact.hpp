// Do two features touch at the start of the step? Exact. This is enough for bodies at rest on each
// other, and for everything that starts in contact.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

enum class AtStart { apart, touching, unknown };

// unknown where no coordinate is the same in all and those on one axis span more than 116 bits.
// row: 4 vertices.
AtStart at_start(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
