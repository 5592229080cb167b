// Decides whether a moving vertex meets a moving face, and whether two moving edges meet.
#pragma once

#include <cstddef>
#include <cstdint>

#include "ends.hpp"
#include "impact.hpp"
#include "k_dop.hpp"
#include "tauguard/geometry/fields.hpp"

namespace tauguard::cloth {

// Both methods are exact for the given doubles. `exact` uses only exact arithmetic and is the
// reference for ab2pf. Only ab2pf supports a minimum distance, with conservative results.
enum class Method : int { ab2pf = 0, exact };

// Numbers of queries.
struct Stats {
  std::uint64_t axes = 0;        // without contact: apart on an axis
  std::uint64_t cubic_sign = 0;  // without contact: the cubic has no root
  std::uint64_t roots = 0;       // without contact at any root
  std::uint64_t at_start = 0;    // in contact at the start of the step
  std::uint64_t sliding = 0;     // decided in a plane perpendicular to an axis
  std::uint64_t resolved = 0;    // decided one by one (resolve)
  std::uint64_t intervals = 0;   // number of intervals of time that `resolved` queries needed
  std::uint64_t exact = 0;       // decided in exact arithmetic
  std::uint64_t long_exact = 0;  // of `exact`: with integers of any length
  TAUGUARD_FIELDS(axes, cubic_sign, roots, at_start, sliding, resolved, intervals, exact,
                  long_exact)
  Stats& operator+=(const Stats& o) {
    geometry::add_fields(*this, o);
    return *this;
  }
};

// The filter of apart.hpp, by which ab2pf rejects queries. Results do not depend on it.
struct AxisFilter {
  bool look = true;  // false: no filter, because the broad phase has compared the axes already
  // Projections of the positions onto `seven_axes`, which pay off from a few queries per vertex. If
  // null, x, y and z are compared.
  const Projection* points = nullptr;
};

// Solve n queries. rows: (n, 4) vertices: vertex and face, or edge and edge. `hit` and `impacts`
// are outputs; `stats` is incremented. Callable from several threads. Needs round-to-nearest.
void solve_vf(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes);
void solve_ee(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes);

}  // namespace tauguard::cloth
