// The descent of gjk.hpp for two hulls. A list of points has a size, an operator [] and a function
// extreme(points, n): the row of the point furthest along n, the first one if there are several.
#pragma once

#include "gjk.hpp"
#include "tauguard/rigid/distance.hpp"

// The descent is inlined, so that it is compiled for the vector unit of each clone.
#define TAUGUARD_FLAT TAUGUARD_CLONES __attribute__((flatten))

namespace tauguard::rigid {

using Rows = std::array<std::size_t, 2>;

inline std::size_t extreme(const PointList& points, const Vec3& n) {
  std::size_t best = 0;
  double most = dot(n, points[0]);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double x = dot(n, points[i]);
    if (most < x) most = x, best = i;
  }
  return best;
}

// Ends the descent when no point of b - a is nearer to the origin by more than rounding errors.
struct ToRounding {
  void visit(const Simplex<Rows>&) {}
  bool enough(const Vec3& v, const Vec3& next) const {
    return dot(v, v) - dot(v, next) <= 1e-14 * dot(v, v);
  }
  void stuck(const Simplex<Rows>&, const Vec3&) {}
};

template <class A, class B, class Watch>
Simplex<Rows> descend_hulls(const A& a, const B& b, Watch& watch) {
  const auto support = [&](const Vec3& v) {
    const std::size_t i = extreme(a, v), j = extreme(b, -1.0 * v);
    return Corner<Rows>{b[j] - a[i], {i, j}, 0};
  };
  return descend(Corner<Rows>{b[0] - a[0], {0, 0}, 1.0}, support, watch, 0.0);
}

template <class A, class B>
Nearest nearest_of(const A& a, const B& b) {
  ToRounding watch;
  const Simplex<Rows> s = descend_hulls(a, b, watch);
  Nearest out{{}, {}, s.size(), {}};
  for (int i = 0; i < s.size(); ++i) {
    const Corner<Rows>& c = s.corner(i);
    out.a = out.a + c.weight * a[c.from[0]];
    out.b = out.b + c.weight * b[c.from[1]];
    out.corner[i] = c.from;
  }
  return out;
}

}  // namespace tauguard::rigid
