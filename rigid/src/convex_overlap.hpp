// The overlap query over a batch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

enum class Method : int { abfme = 0, sat = 1, automatic = 2, textbook_sat = 3, exact = 4 };

// Writes 1 (common point) or 0 (separated) for rows [0, n). Every method is exact, except
// textbook_sat. Returns the number of rows that the filters left undecided.
std::size_t overlap(const Bodies& a, const Bodies& b, std::size_t n, Method method, int threads,
                    std::uint8_t* hit);

// As `overlap`, for boxes that are given both as rows and as blocks of eight (BoxBlock; the last
// block is padded). `skew` bounds |R^T R - I| over both batches.
std::size_t overlap_boxes(const Bodies& a, const void* blocks_a, const Bodies& b,
                          const void* blocks_b, double skew, std::size_t n, int threads,
                          std::uint8_t* hit);

// Sweeps: b moves by t d[i], 0 <= t <= 1; `d` has n rows of 3. Writes `hit` as above. Row i of
// `out` receives time of impact (inf without a hit), point (NaN if `points` is false) and normal.
std::size_t sweep(const Bodies& a, const Bodies& b, const double* d, std::size_t n, Method method,
                  int threads, bool points, std::uint8_t* hit, double* out);

// Decides one row by elimination and writes hit[row].
using RowMethod =
    std::function<void(const Bodies& a, const Bodies& b, std::size_t row, std::uint8_t* hit)>;
RowMethod row_method(Kind a, Kind b, Method method = Method::automatic);

// Like `overlap`, but tests the given normal of each row first (3 numbers; zeros if there is none).
// A normal that does not separate a pair that is apart is replaced by one that does. Returns the
// number of rows that the given normals decided.
std::size_t overlap_cached(const Bodies& a, const Bodies& b, std::size_t n, int threads,
                           double* normals, std::uint8_t* hit);

// The largest entry of |R^T R - I| of n rotations, rounded up, and the first row above `tolerance`,
// or n.
struct Skew {
  double largest;
  std::size_t first_beyond;
};
Skew box_skew(const double* rotation, std::size_t n, double tolerance);

// Writes packed rows as blocks of eight; the last block is filled up with copies of the last box.
void pack_boxes(const double* packed, std::size_t n, double* blocks);

// Writes a common point (3 numbers) or a separating plane (normal and offset) of a row.
void witness(const Bodies& a, const Bodies& b, std::size_t row, bool hit, double* out);

}  // namespace tauguard::rigid
