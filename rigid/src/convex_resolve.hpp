// Decides the rows that the filtered kernels could not decide.
#pragma once

#include <cstddef>

#include "convex_abfme.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

// Overlap of any bodies by the simplex method in double precision, with error bounds. The result is
// `undecided` near contact.
Verdict resolve_hulls(const Bodies& a, const Bodies& b, std::size_t row);

// Overlap of vertex hulls or polygons by elimination in double precision; `undecided` near contact.
Verdict eliminate_hulls(const Bodies& a, const Bodies& b, std::size_t row);

// Overlap of any bodies in exact arithmetic, in tens of microseconds. Never `undecided`.
Verdict resolve_exactly(const Bodies& a, const Bodies& b, std::size_t row);

// Whether B, moved by t d, meets A for some t in [0, 1]. Exact.
Verdict resolve_sweep_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row);

// The time of impact of a pair that meets, and the unit normal of the last separating plane (NaN if
// the pair overlaps from the start). Each step finds a separating plane in exact arithmetic and
// advances to the time at which this plane separates no longer. The search ends when exact
// arithmetic finds contact or when no advance is possible, so the time is never late.
double advance_exactly(const Bodies& a, const Bodies& b, const double* d, std::size_t row,
                       double* normal);

// Writes point (3 numbers), normal (3) and offset (1), up to rounding. The row has either a common
// point or a separating plane (unit normal from a to b, offset). The other numbers are NaN.
// `known` is the verdict on this row.
void find_witness(const Bodies& a, const Bodies& b, std::size_t row, Verdict known, double* out);

}  // namespace tauguard::rigid
