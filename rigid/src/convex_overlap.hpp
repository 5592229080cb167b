// The overlap query over a batch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

enum class Method : int { abfme = 0, sat = 1, automatic = 2, textbook_sat = 3, exact = 4 };

// Writes 1 (common) or 0 (separated) for rows [0, n); exact for every method but textbook_sat,
// whose answers carry the rounding errors of its arithmetic. Returns how many rows the filters left
// undecided.
std::size_t overlap(const Bodies& a, const Bodies& b, std::size_t n, Method method, int threads,
                    std::uint8_t* hit);

// The batch path of boxes, from blocks of eight (see BoxBlock; the last one padded) beside the
// rows. `skew` bounds |R^T R - I| over both batches.
std::size_t overlap_boxes(const Bodies& a, const void* blocks_a, const Bodies& b,
                          const void* blocks_b, double skew, std::size_t n, int threads,
                          std::uint8_t* hit);

// Sweeps: b moves by t d[i], 0 <= t <= 1. Row i of `out`: toi (inf without a hit), point, normal;
// `hit` as above. `d` holds n rows of 3. Without `points` that column stays NaN.
std::size_t sweep(const Bodies& a, const Bodies& b, const double* d, std::size_t n, Method method,
                  int threads, bool points, std::uint8_t* hit, double* out);

// Decides one row by elimination (or the hulls' method) into hit[row].
using RowMethod =
    std::function<void(const Bodies& a, const Bodies& b, std::size_t row, std::uint8_t* hit)>;
RowMethod row_method(Kind a, Kind b);

// As `overlap`, but tries row i's normal (3 numbers, zeros for none) first, and replaces it if it
// fails and the pair is apart. Returns the number of rows that the normals decided.
std::size_t overlap_cached(const Bodies& a, const Bodies& b, std::size_t n, int threads,
                           double* normals, std::uint8_t* hit);

// The largest |R^T R - I| of n rotations (rounded up), and the first row beyond `tolerance` (n:
// none).
struct Skew {
  double largest;
  std::size_t first_beyond;
};
Skew box_skew(const double* rotation, std::size_t n, double tolerance);

// Blocks of eight from packed rows, the last one filled up with copies of the last box.
void pack_boxes(const double* packed, std::size_t n, double* blocks);

void witnesses(const Bodies& a, const Bodies& b, std::size_t n, int threads,
               const std::uint8_t* hit, double* out);

}  // namespace tauguard::rigid
