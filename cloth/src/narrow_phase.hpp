// Vertex-face and edge-edge queries: whether a moving vertex meets a moving face, and whether two
// moving edges meet.
#pragma once

#include <cstddef>
#include <cstdint>

#include "ends.hpp"
#include "impact.hpp"
#include "k_dop.hpp"

namespace tauguard::cloth {

// Both methods are exact for the doubles given. `exact` uses exact arithmetic throughout and is the
// reference of ab2pf. Only ab2pf has a minimum distance, for which it is conservative.
enum class Method : int { ab2pf = 0, exact };

// How many queries each filter removed (apart on an axis; no root of the cubic; no contact at its
// roots); how many touch at the start of the step; how many were decided while sliding on a plane;
// how many were resolved one by one and cut into how many intervals of time; how many exact
// arithmetic decided, and of these with numbers of any length.
struct Stats {
  std::uint64_t axes = 0, cubic_sign = 0, roots = 0, at_start = 0, sliding = 0, resolved = 0,
                intervals = 0, exact = 0, long_exact = 0;
  Stats& operator+=(const Stats& o) {
    axes += o.axes;
    cubic_sign += o.cubic_sign;
    roots += o.roots;
    at_start += o.at_start;
    sliding += o.sliding;
    resolved += o.resolved;
    intervals += o.intervals;
    exact += o.exact;
    long_exact += o.long_exact;
    return *this;
  }
};

// The filter by which ab2pf rejects queries that an axis separates at both ends of the step. It
// compares x, y and z; or `points`, the projections of the positions onto `seven_axes` (apart.hpp),
// which pays off from a few queries per vertex; or nothing, if the broad phase has compared
// already. The answers do not depend on the filter.
struct AxisFilter {
  bool look = true;
  const Projection* points = nullptr;
};

// rows: (n, 4) vertices: vertex and face, or edge and edge. Callable from
// several threads. Needs round-to-nearest.
void solve_vf(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes);
void solve_ee(const Ends& x, const std::int32_t* rows, std::size_t n, Method method,
              double min_distance, std::uint8_t* hit, ImpactArrays impacts, Stats& stats,
              AxisFilter axes);

}  // namespace tauguard::cloth
