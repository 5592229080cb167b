// Decides the rows that the filtered kernels could not decide.
#pragma once

#include <cstddef>

#include "convex_abfme.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

// Any bodies by the simplex method in double precision, with error bounds; `undecided` near
// contact.
Verdict resolve_hulls(const Bodies& a, const Bodies& b, std::size_t row);

// Vertex hulls or polygons by elimination in double precision; `undecided` near contact.
Verdict eliminate_hulls(const Bodies& a, const Bodies& b, std::size_t row);

// Exact: `separated` or `common` for any finite input. Tens of microseconds.
Verdict resolve_exactly(const Bodies& a, const Bodies& b, std::size_t row);

// Does B, moving by t d, meet A for some t in [0, 1]? Exact.
Verdict resolve_sweep_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row);

// The time of impact of a pair that meets, and the unit normal of the last separating plane (NaN if
// the pair overlaps from the start). Each step finds a separating plane in exact arithmetic and
// advances until the bodies reach it. It ends when exact arithmetic finds contact or no advance is
// left, so the time is never late.
double advance_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row,
                       double* normal);

// Writes a common point of row `row`, or the unit normal (from a to b) and offset of a separating
// plane, to rounding. The other numbers are NaN. `known` is the verdict if the caller knows it.
// out: point 3, normal 3, offset 1.
void find_witness(const Bodies& a, const Bodies& b, std::size_t row, Verdict known, double* out);

}  // namespace tauguard::rigid
