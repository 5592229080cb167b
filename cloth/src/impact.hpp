// Point, normal and weights of a collision whose time is known.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ends.hpp"
#include "query.hpp"

namespace tauguard::cloth {

// Output of queries. Row i is written if query i has contact. The weights belong to the four
// vertices of the row: (1, w0, w1, w2) for a vertex and a face, or (1 - s, s, 1 - t, t) for two
// edges. All pointers except `toi` are null if only times are needed.
struct ImpactArrays {
  double *toi, *point, *normal, *weights;  // shapes (n), (n, 3), (n, 3), (n, 4)
};

inline Vec3 at(const Ends& x, std::int32_t v, double t) { return mix(x(false, v), x(true, v), t); }

// Weights of the point nearest to `a` on the longest edge of a degenerate face (b, c, d).
inline void on_longest_edge(Vec3 a, Vec3 b, Vec3 c, Vec3 d, double* w) {
  const Vec3 ends[3][2] = {{b, c}, {b, d}, {c, d}};
  constexpr int weight[3][2] = {{1, 2}, {1, 3}, {2, 3}};
  int longest = 0;
  const auto length = [&](int i) { return largest(ends[i][1] - ends[i][0]); };
  for (int i = 1; i < 3; ++i)
    if (length(i) > length(longest)) longest = i;
  const Vec3 from = ends[longest][0];
  const double size = length(longest), scale = size > 0 ? 1 / size : 0;
  const Vec3 e = scale * (ends[longest][1] - from);
  const double ee = dot(e, e), s = ee > 0 ? dot(scale * (a - from), e) / ee : 0;
  w[1] = w[2] = w[3] = 0;
  w[weight[longest][1]] = std::clamp(s, 0.0, 1.0);
  w[weight[longest][0]] = 1 - w[weight[longest][1]];
}

// Computes point, normal and weights of the contact at time t.
template <bool vf>
void describe(const Ends& x, const std::int32_t* row, double t, ImpactArrays out, std::size_t i) {
  const Vec3 a = at(x, row[0], t), b = at(x, row[1], t), c = at(x, row[2], t), d = at(x, row[3], t);
  const Vec3 q = vf ? c - b : b - a, r = vf ? d - b : d - c, p = vf ? a - b : c - a;
  Vec3 n = cross(q, r);
  const double nn = dot(n, n);
  double* w = out.weights + 4 * i;
  Vec3 point = a;
  if (vf) {
    const double v1 = nn > 0 ? dot(cross(p, r), n) / nn : 0,
                 v2 = nn > 0 ? dot(cross(q, p), n) / nn : 0;
    w[0] = 1;
    w[2] = std::clamp(v1, 0.0, 1.0);
    w[3] = std::clamp(v2, 0.0, 1.0 - w[2]);
    w[1] = 1 - w[2] - w[3];
    if (!(nn > 0)) on_longest_edge(a, b, c, d, w);
  } else {
    const double s = nn > 0 ? std::clamp(dot(cross(p, r), n) / nn, 0.0, 1.0) : 0;
    const double e = nn > 0 ? std::clamp(dot(cross(p, q), n) / nn, 0.0, 1.0) : 0;
    w[0] = 1 - s;
    w[1] = s;
    w[2] = 1 - e;
    w[3] = e;
    point = a + s * q;
  }
  const double length = std::sqrt(nn);
  n = length > 0 ? (1 / length) * n : Vec3{0, 0, 0};
  const double pt[] = {point.x, point.y, point.z}, nl[] = {n.x, n.y, n.z};
  std::copy(pt, pt + 3, out.point + 3 * i);
  std::copy(nl, nl + 3, out.normal + 3 * i);
}

}  // namespace tauguard::cloth
