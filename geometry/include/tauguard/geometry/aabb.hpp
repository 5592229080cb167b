// Axis-aligned bounding box. Minima and maxima of doubles are exact, so `add` rounds nothing.
#pragma once

#include <algorithm>
#include <limits>

namespace tauguard::geometry {

struct Aabb {
  double lo[3] = {std::numeric_limits<double>::infinity(), std::numeric_limits<double>::infinity(),
                  std::numeric_limits<double>::infinity()};
  double hi[3] = {-std::numeric_limits<double>::infinity(),
                  -std::numeric_limits<double>::infinity(),
                  -std::numeric_limits<double>::infinity()};

  void add(const double* p) {
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], p[k]);
      hi[k] = std::max(hi[k], p[k]);
    }
  }

  void add(const Aabb& o) {
    for (int k = 0; k < 3; ++k) {
      lo[k] = std::min(lo[k], o.lo[k]);
      hi[k] = std::max(hi[k], o.hi[k]);
    }
  }

  void widen(double by) {
    for (int k = 0; k < 3; ++k) lo[k] -= by, hi[k] += by;
  }

  // Touching boxes overlap.
  bool overlaps(const Aabb& o) const {
    return lo[0] <= o.hi[0] && o.lo[0] <= hi[0] && lo[1] <= o.hi[1] && o.lo[1] <= hi[1] &&
           lo[2] <= o.hi[2] && o.lo[2] <= hi[2];
  }

  int longest_axis() const {
    const double x = hi[0] - lo[0], y = hi[1] - lo[1], z = hi[2] - lo[2];
    return x >= y && x >= z ? 0 : (y >= z ? 1 : 2);
  }
};

}  // namespace tauguard::geometry
