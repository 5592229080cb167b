// Whether a translating body meets another within the step. Body B moves by t d, 0 <= t <= 1. The
// method is the elimination of convex_abfme.hpp with the unknown t, which is eliminated first. The
// rows for t = 0 and t = 1 imply all others. So every vertex of B gives two rows, one for each end
// of the motion. The hull of both ends has the facets of B and facets with normals f x d, for edges
// f of B.
#pragma once

#include "convex_sat.hpp"

namespace tauguard::rigid {

// The four points p + d. The error of p and of p + d is at most 2 u reach, which the slack of the
// bounds of convex_abfme.hpp covers.
TAUGUARD_INLINE void moved(const double (*p)[3], const double* d, double (*out)[3]) {
  for (int j = 0; j < 4; ++j)
    for (int k = 0; k < 3; ++k) out[j][k] = p[j][k] + d[k];
}

TAUGUARD_INLINE Verdict swept_tetrahedra(const double* a, const double* b, const double* d) {
  const TetrahedronFacets fa(a), fb(b);
  double p[8][3], q[8][3];
  const double back[3] = {-d[0], -d[1], -d[2]}, length = norm1(d);
  const double reach = offsets_from(b, a, p) + length, far = offsets_from(a, b, q) + length;
  moved(p, d, p + 4), moved(q, back, q + 4);
  if (!in_range(fa.size) || !in_range(fb.size) || !in_range(reach) || !in_range(length))
    return undecided;
  Double4 row[8], top_a{}, top_b{};
  for (int j = 0; j < 8; ++j) {
    row[j] = fa.at(p[j]);
    top_a = j == 0 ? row[0] : max(top_a, row[j]);
    top_b = j == 0 ? fb.at(q[0]) : max(top_b, fb.at(q[j]));
  }
  const double ea = tetrahedron_error(fa.size, reach), eb = tetrahedron_error(fb.size, far);
  if (any((top_a < -ea) | (top_b < -eb))) return separated;
  bool certain = all((fa.determinant > ea) & (fb.determinant > eb) & (top_a > ea) & (top_b > eb));

  const TetrahedronEdges f(b);
  Double4 c[3], low, high;
  cross_with(p, d, c);
  const double ed = edge_error(length, 2 * fb.size, reach + fa.size);
  for (int group = 0; group < 2; ++group) {
    f.range(group, c, low, high);
    Double4 own_low{}, own_high{};
    for (int i = 0; i < 4; ++i) {
      double x[3], xd[3];
      for (int k = 0; k < 3; ++k) x[k] = a[3 * i + k] - a[k];
      cross(x, d, xd);
      const Double4 v = f.dot(group, xd);
      own_low = i == 0 ? v : min(own_low, v);
      own_high = i == 0 ? v : max(own_high, v);
    }
    const Double4 gap = max(low - own_high, own_low - high);
    if (any(gap > ed)) return separated;
    certain = certain && all(gap < -ed);
  }

  Double4 x[8], y[8];
  for (int pass = 0; pass < 2; ++pass) {
    const auto open = [&](double shift) __attribute__((always_inline)) {
      for (int j = 0; j < 8; ++j) {
        x[j] = row[j] + shift;
        y[j] = pass == 0 ? turn1(x[j]) : turn2(x[j]);
      }
      return any(leaves_interval<8>(x, y));
    };
    if (!open(-ea)) continue;
    if (open(ea)) return separated;
    certain = false;
  }
  return certain ? common : undecided;
}

TAUGUARD_INLINE Verdict swept_zonotope_tetrahedron(const Zonotope& a, const double* b,
                                                   const double* d) {
  const Slabs sa(a);
  const TetrahedronFacets fb(b);
  double p[8][3], q[3], q1[3], far = 0.0;
  const double length = norm1(d);
  double reach = offsets_from(b, a.origin, p);
  for (int j = 0; j < 4; ++j)
    for (int k = 0; k < 3; ++k) p[j][k] -= a.shift[k];
  moved(p, d, p + 4);
  for (int k = 0; k < 3; ++k) {
    q[k] = a.origin[k] - b[k];
    far += std::fabs(q[k]);
    q[k] += a.shift[k];
    q1[k] = q[k] - d[k];
  }
  reach += 3 * sa.size + length;
  if (!in_range(sa.size) || !in_range(fb.size) || !in_range(reach) || !in_range(length))
    return undecided;
  const double ea = 32 * unit * sa.size * sa.size * reach, wall = sa.determinant;
  Double4 row[8], top{}, bottom{};
  for (int j = 0; j < 8; ++j) {
    row[j] = sa.at(p[j]);
    top = j == 0 ? row[0] : max(top, row[j]);
    bottom = j == 0 ? row[0] : min(bottom, row[j]);
  }
  if (any((bottom > wall + ea) | (top < -wall - ea))) return separated;
  Double4 column = max(fb.at(q), fb.at(q1));
  for (const auto& g : a.g) column += abs(fb.n[0] * g[0] + fb.n[1] * g[1] + fb.n[2] * g[2]);
  const double eb = tetrahedron_error(fb.size, far + 6 * sa.size + length);
  if (any(column < -eb)) return separated;
  bool certain = wall > ea && all((fb.determinant > eb) & (column > eb) & (bottom < wall - ea) &
                                  (top > ea - wall));

  const TetrahedronEdges f(b);
  Double4 c[3], low, high;
  cross_with(p, d, c);
  const double ed = edge_error(length, 2 * fb.size, reach);
  for (int group = 0; group < 2; ++group) {
    f.range(group, c, low, high);
    Double4 radius{};
    for (const auto& g : a.g) {
      double gd[3];
      cross(g, d, gd);
      radius += abs(f.dot(group, gd));
    }
    const Double4 gap = max(low - radius, -radius - high);
    if (any(gap > ed)) return separated;
    certain = certain && all(gap < -ed);
  }

  const Double4 side_x{1.0, 1.0, -1.0, -1.0}, side_y{1.0, -1.0, 1.0, -1.0};
  Double4 x[8], y[8];
  for (int i = 0; i < 3; ++i) {
    const int k = i == 2 ? 0 : i + 1;
    const auto open = [&](double shift) __attribute__((always_inline)) {
      for (int j = 0; j < 8; ++j) {
        x[j] = wall - side_x * row[j][i] + shift;
        y[j] = wall - side_y * row[j][k] + shift;
      }
      return any(leaves_interval<8>(x, y));
    };
    if (!open(-ea)) continue;
    if (open(ea)) return separated;
    certain = false;
  }
  return certain ? common : undecided;
}

// The hull of a zonotope at t = 0 and t = 1 is a zonotope with d / 2 as a fourth generator.
TAUGUARD_INLINE Verdict swept_zonotopes(const Zonotope& a, const Zonotope& b, const double* d) {
  const Slabs sa(a);
  double g[4][3], m[3], w = norm1(d), size = 0.5 * w;
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 3; ++i) g[i][k] = b.g[i][k];
    g[3][k] = 0.5 * d[k];
    m[k] = b.origin[k] - a.origin[k];
    w += std::fabs(m[k]);
    m[k] += b.shift[k] - a.shift[k];
    m[k] += g[3][k];
  }
  for (const auto& x : b.g) size = std::max(size, norm1(x));
  w += 3 * (sa.size + size);
  if (!in_range(sa.size) || !in_range(size) || !in_range(w)) return undecided;
  Double4 gap = abs(sa.at(m)) - sa.determinant;
  for (const auto& x : g) gap -= abs(sa.at(x));
  const double ea = 64 * unit * sa.size * sa.size * w;
  if (any(gap > ea)) return separated;
  bool certain = all(gap < -ea);

  Double4 f[3];
  for (int k = 0; k < 3; ++k) f[k] = Double4{g[0][k], g[1][k], g[2][k], g[3][k]};
  // Facets of B, by pairs of generators: (0, 1), (1, 2), (2, 3), (3, 0), then (0, 2), (1, 3) twice.
  const double eb = edge_error(size, size, w);
  for (int pass = 0; pass < 2; ++pass) {
    Double4 h[3], n[3];
    for (int k = 0; k < 3; ++k) h[k] = pass == 0 ? turn1(f[k]) : turn2(f[k]);
    for (int k = 0; k < 3; ++k) {
      const int l = (k + 1) % 3, r = (k + 2) % 3;
      n[k] = f[l] * h[r] - f[r] * h[l];
    }
    const auto along = [&](const double* x) __attribute__((always_inline)) {
      return abs(n[0] * x[0] + n[1] * x[1] + n[2] * x[2]);
    };
    gap = along(m);
    for (const auto& x : a.g) gap -= along(x);
    for (const auto& x : g) gap -= along(x);
    if (any(gap > eb)) return separated;
    certain = certain && all(gap < -eb);
  }
  const double ee = edge_error(sa.size, size, w);
  for (int i = 0; i < 3; ++i) {
    const double* e = a.g[i];
    double xe[3];
    const auto along = [&](const double* x) __attribute__((always_inline)) {
      cross(x, e, xe);
      return abs(f[0] * xe[0] + f[1] * xe[1] + f[2] * xe[2]);
    };
    gap = along(m) - along(a.g[(i + 1) % 3]) - along(a.g[(i + 2) % 3]);
    for (const auto& x : g) gap -= along(x);
    if (any(gap > ee)) return separated;
    certain = certain && all(gap < -ee);
  }
  return certain ? common : undecided;
}

}  // namespace tauguard::rigid
