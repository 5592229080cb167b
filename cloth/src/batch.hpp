// Solves several queries at a time: their coplanarity cubics, and the contacts at the roots.
#pragma once

#include <cstdint>
#include <limits>

#include "ends.hpp"
#include "start_contact.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using namespace geometry;  // lanes.hpp; argument-dependent lookup does not find vector functions

inline constexpr int width = 4;

// `width` queries.
struct Group {
  enum Field { cubic = 0, error = 4, big = 5, scale = 6, fields = 7 };
  // The largest difference is the largest coordinate of a query's three vectors between vertices,
  // at both ends of the step. scale: a power of two that brings it into [1, 2); big: the largest
  // difference times `scale`. The cubic and its error are those of the scaled query.
  alignas(64) double value[fields][width];
  enum Flag : std::int64_t {
    odd = 1,       // the largest difference is too small, too large or not finite
    no_root = 2,   // not odd, and the Bernstein coefficients certainly have one sign
    one_root = 4,  // not odd, and the coefficients certainly change their sign once
    open = 8       // odd, or the cubic may be zero at an end of the step: no cut can decide
  };
  std::int64_t flags[width];
};

// A part [start, start + length] of the step in which the cubic of a query certainly has one root.
struct Piece {
  double start, length, cubic[4];
  std::int32_t query;
};
// Values that a piece or a query can have in place of a time of contact. `never`: no contact.
// `edge`: rounding leaves open whether the contact point is in the feature. `unknown`: rounding
// leaves open whether there is a root.
inline constexpr double never = std::numeric_limits<double>::infinity(), edge = -1, unknown = -2;

// The result of cutting the cubics of some queries once.
struct Cut {
  int pieces = 0;  // number of pieces written, sorted by query and time
  int clear = 0;   // number of queries without a piece
  int left = 0;    // number of queries that need more cuts
};

struct BatchKernels {
  // The exact filter of apart.hpp, by x, y and z.
  int (*not_apart)(bool vf, const Ends& x, const std::int32_t* rows, int n, std::int32_t* left);
  // The filter of apart.hpp by seven axes. points: the projections of the vertices.
  int (*not_apart_on_seven)(bool vf, const float* points, const std::int32_t* rows, int n,
                            std::int32_t* left);
  // Gathers n queries into (n + width - 1) / width groups. Copies of the last query fill the last
  // group.
  void (*gather)(bool vf, const Ends& x, const std::int32_t* rows, int n, Group* groups);
  // Whether the features of each of n queries (indices into the rows) touch at the start. The
  // result is exact, or `unknown` where neither two vertices coincide nor a plane of two axes
  // decides.
  void (*at_start)(bool vf, const Ends& x, const std::int32_t* rows, const std::int32_t* queries,
                   int n, AtStart* found);
  // Cuts the cubics of n queries (indices into the groups) once. Queries that need more cuts are
  // moved to the front of `queries`. `pieces` has room for 2 n + 1.
  Cut (*cut)(const Group* groups, std::int32_t* queries, int n, Piece* pieces);
  // For each piece: a time at most 2^-32 before the contact at its root, or `never`, `edge` or
  // `unknown`. Writes toi up to a multiple of `width`.
  void (*at_roots)(bool vf, const Ends& x, const std::int32_t* rows, const Group* groups,
                   const Piece* pieces, int n, double* toi);
};

// The fastest kernels that this processor can run. Every variant gives the same bits.
const BatchKernels& batch_kernels();
// The kernels "portable" or "avx2"; null if the processor cannot run them.
const BatchKernels* batch_kernels(const char* name);
// For tests: selects the kernels of this name from now on. If there are none, selects the fastest
// ones and returns false.
bool force_batch_kernels(const char* name);

}  // namespace tauguard::cloth
