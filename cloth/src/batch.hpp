// Several queries at a time: the coplanarity cubics of many queries, and what happens at their
// roots.
#pragma once

#include <cstdint>

#include "ends.hpp"

#include "tauguard/geometry/lanes.hpp"

namespace tauguard::cloth {

using namespace geometry;  // lanes.hpp: vector types have no namespace to be found by

inline constexpr int width = 4;

// `width` queries. Their differences (query.hpp) stay query by query: most have no root, and those
// that have are looked at by pieces.
struct Group {
  enum Field { cubic = 0, error = 4, big = 5, scale = 6, fields = 7 };
  enum Difference { p, q, r, differences };
  alignas(64) double of[width][2][differences][4];  // x, y, z and a spare, at both ends
  // big: the largest difference times `scale`, a power of two that brings it into [1, 2). The cubic
  // and its error are of the scaled query.
  alignas(64) double value[fields][width];
  // A bit per query, beyond rounding: the Bernstein coefficients of its cubic have one sign, so
  // that it has no root; or one variation, so that it has one. Both 0 where the query's size keeps
  // it out of this.
  std::uint8_t no_root, one_root;
  std::uint8_t odd;   // that size: too small, too large or not finite
  std::uint8_t open;  // odd, or the cubic may be zero at an end of the step: no cut can decide
};

// A part [start, start + length] of a query's time in which its cubic has exactly one root, beyond
// rounding.
struct Piece {
  double start, length, cubic[4];
  std::int32_t query;
};
// edge: so close to the boundary of a feature that rounding hides the side; unknown: so is the root
// itself.
enum class Outcome : std::uint8_t { clear, contact, edge, unknown };

// What became of queries whose cubics were cut once.
struct Cut {
  int pieces = 0;  // written: each query's in a row, in order of time
  int clear = 0;   // queries without a piece
  int left = 0;    // queries for which one cut does not suffice
};

struct BatchKernels {
  // The queries of n that no axis (x, y or z) keeps apart, on the same side at both ends of the
  // step and so in between: their numbers go to `left`. Comparisons of coordinates only, and so
  // exact.
  int (*not_apart)(bool vf, const Ends& x, const std::int32_t* rows, int n, std::int32_t* left);
  // The same by seven axes (apart.hpp), beyond rounding; points: of those positions.
  int (*not_apart_on_seven)(bool vf, const float* points, const std::int32_t* rows, int n,
                            std::int32_t* left);
  // (n + width - 1) / width groups of n queries; the last is filled up with copies of the last
  // query.
  void (*gather)(bool vf, const Ends& x, const std::int32_t* rows, int n, Group* groups);
  // Cuts the cubics of n queries (numbers into the groups) once; those left take the first places
  // of `queries`.
  Cut (*cut)(const Group* groups, std::int32_t* queries, int n, Piece* pieces);
  // Per piece: is there contact at its root, and from when on can that be (at most 2^-32 before
  // it).
  void (*at_roots)(bool vf, const Group* groups, const Piece* pieces, int n, Outcome* outcome,
                   double* toi);
};

// The fastest that this processor runs; every variant gives the same bits.
const BatchKernels& batch_kernels();
// By name: "portable", "avx2"; null where the processor lacks it.
const BatchKernels* batch_kernels(const char* name);
// For tests: these from now on; the fastest again, and false, where there are none of that name.
bool force_batch_kernels(const char* name);

}  // namespace tauguard::cloth
