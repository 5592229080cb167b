// Solves several queries at a time: their coplanarity cubics, and the contacts at the roots.
#pragma once

#include <cstdint>

#include "ends.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using namespace geometry;  // lanes.hpp: vector types have no namespace to be found by

inline constexpr int width = 4;

// `width` queries. Their differences (query.hpp) are stored query by query, because most queries
// have no root and the others are tested piece by piece.
struct Group {
  enum Field { cubic = 0, error = 4, big = 5, scale = 6, fields = 7 };
  enum Difference { p, q, r, differences };
  alignas(64) double of[width][2][differences][4];  // x, y, z and a spare, at both ends
  // big: the largest difference times `scale`, a power of two that brings it into [1, 2). The cubic
  // and its error are of the scaled query.
  alignas(64) double value[fields][width];
  // One bit per query. no_root: the Bernstein coefficients of its cubic have one sign. one_root:
  // they change sign once. Both hold beyond rounding, and both are 0 for queries of an odd size.
  std::uint8_t no_root, one_root;
  std::uint8_t odd;   // its size is too small, too large or not finite
  std::uint8_t open;  // odd, or the cubic may be zero at an end of the step: no cut can decide
};

// A part [start, start + length] of a query's time in which its cubic has exactly one root, beyond
// rounding.
struct Piece {
  double start, length, cubic[4];
  std::int32_t query;
};
// edge: rounding hides on which side of a feature's boundary the contact lies; unknown: rounding
// hides the root itself.
enum class Outcome : std::uint8_t { clear, contact, edge, unknown };

// Numbers of queries after their cubics were cut once.
struct Cut {
  int pieces = 0;  // that were written, query by query and in order of time
  int clear = 0;   // queries without a piece
  int left = 0;    // queries for which one cut does not suffice
};

struct BatchKernels {
  // Writes to `left` the numbers of the queries that x, y and z do not separate on the same side at
  // both ends of the step. Exact: it only compares coordinates.
  int (*not_apart)(bool vf, const Ends& x, const std::int32_t* rows, int n, std::int32_t* left);
  // The same with seven axes (apart.hpp), beyond rounding; points: their projections.
  int (*not_apart_on_seven)(bool vf, const float* points, const std::int32_t* rows, int n,
                            std::int32_t* left);
  // Gathers n queries into (n + width - 1) / width groups. Copies of the last query fill the last
  // group.
  void (*gather)(bool vf, const Ends& x, const std::int32_t* rows, int n, Group* groups);
  // Cuts the cubics of n queries (indices into the groups) once. Queries that need more cuts are
  // moved to the front of `queries`.
  Cut (*cut)(const Group* groups, std::int32_t* queries, int n, Piece* pieces);
  // For each piece: whether there is contact at its root, and a time at most 2^-32 before it.
  void (*at_roots)(bool vf, const Group* groups, const Piece* pieces, int n, Outcome* outcome,
                   double* toi);
};

// The fastest kernels that this processor runs. Every variant gives the same bits.
const BatchKernels& batch_kernels();
// The kernels of that name, "portable" or "avx2"; null if the processor lacks them.
const BatchKernels* batch_kernels(const char* name);
// For tests: uses the kernels of that name from now on. If there are none, uses the fastest ones
// and returns false.
bool force_batch_kernels(const char* name);

}  // namespace tauguard::cloth
