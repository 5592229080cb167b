// What the filtered kernels could not decide.
#pragma once

#include <cstddef>

#include "convex_abfme.hpp"
#include "convex_bodies.hpp"

namespace tauguard::rigid {

// Exact: `separated` or `common` for any finite input. Tens of microseconds.
Verdict resolve_exactly(const Bodies& a, const Bodies& b, std::size_t row);

// A common point, or the unit normal (from a to b) and offset of a separating plane, of row `row`,
// rounded from exact values; the rest is NaN. out: point 3, normal 3, offset 1.
void find_witness(const Bodies& a, const Bodies& b, std::size_t row, double* out);

}  // namespace tauguard::rigid
