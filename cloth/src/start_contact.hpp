// Whether two features touch at the start of the step, for example at rest on each other. Exact.
#pragma once

#include <cstdint>

#include "ends.hpp"

namespace tauguard::cloth {

enum class AtStart { apart, touching, unknown };

// If all vertices are in one plane, the differences between points of the two features fill a
// polygon. Each row (o, a, b) of vertices gives a side of it: one corner is the difference of o and
// a, the other that of o and b. The cross product of the corners is (a - o) x (b - o).
template <bool vf>
inline constexpr int sides_of[3][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
template <>
inline constexpr int sides_of<false>[4][3] = {{0, 2, 3}, {3, 0, 1}, {1, 3, 2}, {2, 1, 0}};

// The result is `unknown` if no coordinate is the same in all vertices and the coordinates on one
// axis span more than 116 bits. row: 4 vertices.
AtStart at_start(bool vf, const Ends& x, const std::int32_t* row);

}  // namespace tauguard::cloth
