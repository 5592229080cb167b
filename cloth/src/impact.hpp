// Point, normal and weights of a collision whose time is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ends.hpp"
#include "query.hpp"
#include "tauguard/geometry/feature_gap.hpp"

namespace tauguard::cloth {

// Output of queries. Row i is written if query i has contact. The weights belong to the four
// vertices of the row: (1, w0, w1, w2) for a vertex and a face, or (1 - s, s, 1 - t, t) for two
// edges. All pointers except `toi` are null if only times are needed.
struct ImpactArrays {
  double *toi, *point, *normal, *weights;  // shapes (n), (n, 3), (n, 3), (n, 4)
};

// Computes point, normal and weights of the contact at time t, for a minimum distance.
//
// The two points of the weights coincide except for
// * the movement within 1e-9 of the step, by which t may be early: with M, the largest component of
//   a displacement relative to that of the first vertex, at most 2e-9 sqrt 3 M < 2^-28 M, and
// * rounding, at most 2^-44 of the largest coordinate.
// The plane's solution is used where it reaches this bound, and the sine between q and r is above
// about 2^-20. Otherwise, and for all contacts at a distance, the shortest gap is searched.
template <bool vf>
void describe(const Ends& x, const std::int32_t* row, double t, double distance, ImpactArrays out,
              std::size_t i) {
  Vec3 start[4], end[4], at[4];
  double big = 0, moved = 0;
  for (int k = 0; k < 4; ++k) {
    start[k] = x(false, row[k]);
    end[k] = x(true, row[k]);
    big = std::max({big, largest(start[k]), largest(end[k])});
  }
  const double scale = big > 0x1p-200 && big < 0x1p200 ? 1 : geometry::unit_scale(big);
  for (int k = 0; k < 4; ++k) {
    start[k] = scale * start[k];
    end[k] = scale * end[k];
    at[k] = mix(start[k], end[k], t);
    moved = std::max(moved, largest(end[k] - start[k] - (end[0] - start[0])));
  }
  const auto [a, b, c, d] = at;
  const geometry::Gap<vf> gap{vf ? a - b : c - a, vf ? c - b : b - a, vf ? d - b : c - d};
  auto uv = gap.in_domain(gap.perpendicular(gap.p));
  const double rounding = 0x1p-44 * scale * big, enough = 0x1p-28 * moved + rounding;
  if (distance > 0 || !(gap.nn > 0x1p-40 && gap.size(uv) <= enough))
    uv = gap.shortest(distance > 0 ? rounding : enough);

  double* w = out.weights + 4 * i;
  w[0] = vf ? 1 : 1 - uv.u;
  w[1] = vf ? 1 - uv.u - uv.v : uv.u;
  w[2] = vf ? uv.u : 1 - uv.v;
  w[3] = uv.v;
  const Vec3 point = (1 / scale) * (vf ? a : a + uv.u * gap.q);
  const double length = std::sqrt(gap.nn);
  const Vec3 n = length > 0 ? ((vf ? 1 : -1) / length) * gap.n : Vec3{0, 0, 0};
  std::copy(point.begin(), point.end(), out.point + 3 * i);
  std::copy(n.begin(), n.end(), out.normal + 3 * i);
}

}  // namespace tauguard::cloth
