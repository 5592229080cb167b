// The axes of discrete oriented polytopes (k-DOPs, Klosowski et al. 1998). A k-DOP is an interval
// on each of k / 2 fixed axes.
#pragma once

#include <cstdint>

namespace tauguard::geometry {

// Rows of {-1, 0, 1}, not normalised. Edge diagonals come before corner diagonals, so that the axes
// of a 16-DOP are a prefix of those of an 18-DOP, and these of those of a 26-DOP.
inline constexpr std::int8_t k_dop_axes[13][3] = {
    {1, 0, 0},  {0, 1, 0},  {0, 0, 1}, {1, 1, 0},  {1, 0, 1},  {0, 1, 1},  {1, -1, 0},
    {1, 0, -1}, {0, 1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};
// The axes of a 14-DOP, a box with cut corners.
inline constexpr std::int8_t k_dop_corner_axes[7][3] = {
    {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}, {1, -1, -1}};

// The axis of the edge diagonal x_i + x_j, or x_i - x_j, for i < j.
constexpr int edge_axis(int i, int j, bool difference) { return i + j + 2 + 3 * difference; }

}  // namespace tauguard::geometry
