// The axes of discrete oriented polytopes (k-DOPs, Klosowski et al. 1998). A k-DOP bounds a set by
// one interval along each of k / 2 fixed axes.
#pragma once

#include <cstdint>

namespace tauguard::geometry {

// Axes with components -1, 0 or 1, not normalised: coordinate axes, edge diagonals, then corner
// diagonals. A 16-DOP has the first 8 of them, an 18-DOP the first 9, and a 26-DOP all 13.
inline constexpr std::int8_t k_dop_axes[13][3] = {
    {1, 0, 0},  {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, 0, 1},  {0, 1, 1},  {1, -1, 0},
    {1, 0, -1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
// The axes of a 14-DOP, a box with cut corners.
inline constexpr std::int8_t k_dop_corner_axes[7][3] = {
    {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

// The axis of the edge diagonal x_i + x_j, or x_i - x_j, for i < j.
constexpr int edge_axis(int i, int j, bool difference) { return i + j + 2 + 3 * difference; }

}  // namespace tauguard::geometry
