// Pairs of boxes along the axes that overlap, among many.
#pragma once

#include <cstdint>
#include <vector>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

struct Range3 {
  double low[3], high[3];
};

// A box around the body of row `row`, grown by a ball. Rounding is included. Not for half-spaces.
Range3 bounds_of(const Bodies& bodies, std::size_t row, double radius);

// The pairs (i, j), i < j, of boxes that overlap after each is grown by `by` on every side;
// touching counts. Sorted. A box may be infinite.
std::vector<std::int32_t> overlapping_boxes(const Range3* boxes, std::size_t n, double by,
                                            int threads);

}  // namespace tauguard::rigid
