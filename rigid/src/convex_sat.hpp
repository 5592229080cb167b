// Overlap by separating axes, four axes at once. Normals and edge products are computed once for
// all projections. Only vertices that can be extreme are projected. Every test has an error bound
// as in convex_abfme.hpp. For edges e of A and f of B, the projection of a point x on the axis e x
// f is f . (x cross e), so the product x cross e is computed once for all edges of B.
#pragma once

#include "convex_abfme.hpp"

namespace tauguard::rigid {

// The edges of a tetrahedron in two groups of three: 01 02 03, and their opposites 23 31 12.
struct TetrahedronEdges {
  Double4 f[2][3];
  TAUGUARD_INLINE explicit TetrahedronEdges(const double* v) {
    for (int k = 0; k < 3; ++k) {
      const Double4 x{v[k], v[3 + k], v[6 + k], v[9 + k]};
      f[0][k] = __builtin_shufflevector(x, x, 1, 2, 3, 3) - x[0];
      f[1][k] =
          __builtin_shufflevector(x, x, 3, 1, 2, 2) - __builtin_shufflevector(x, x, 2, 3, 1, 1);
    }
  }
  TAUGUARD_INLINE Double4 dot(int group, Double4 x, Double4 y, Double4 z) const {
    return f[group][0] * x + f[group][1] * y + f[group][2] * z;
  }
  TAUGUARD_INLINE Double4 dot(int group, const double* x) const {
    return f[group][0] * x[0] + f[group][1] * x[1] + f[group][2] * x[2];
  }
  // The range of the four vertices' projections on the axes of a group. c[k] is component k of
  // x cross e, with one vertex x per lane.
  TAUGUARD_INLINE void range(int group, const Double4* c, Double4& low, Double4& high) const {
    Double4 p, q, r;
    if (group == 0) {
      p = dot(0, splat(c[0][0]), splat(c[1][0]), splat(c[2][0]));
      q = dot(0, pick<2, 1, 1>(c[0]), pick<2, 1, 1>(c[1]), pick<2, 1, 1>(c[2]));
      r = dot(0, pick<3, 3, 2>(c[0]), pick<3, 3, 2>(c[1]), pick<3, 3, 2>(c[2]));
    } else {
      p = dot(1, splat(c[0][0]), splat(c[1][0]), splat(c[2][0]));
      q = dot(1, pick<2, 3, 1>(c[0]), pick<2, 3, 1>(c[1]), pick<2, 3, 1>(c[2]));
      r = dot(1, pick<1, 2, 3>(c[0]), pick<1, 2, 3>(c[1]), pick<1, 2, 3>(c[2]));
    }
    low = min(p, min(q, r));
    high = max(p, max(q, r));
  }

 private:
  template <int I, int J, int K>
  TAUGUARD_INLINE static Double4 pick(Double4 x) {
    return __builtin_shufflevector(x, x, I, J, K, K);
  }
};

TAUGUARD_INLINE void cross_with(const double (*p)[3], const double* e, Double4* c) {
  const Double4 x{p[0][0], p[1][0], p[2][0], p[3][0]}, y{p[0][1], p[1][1], p[2][1], p[3][1]},
      z{p[0][2], p[1][2], p[2][2], p[3][2]};
  c[0] = y * e[2] - z * e[1];
  c[1] = z * e[0] - x * e[2];
  c[2] = x * e[1] - y * e[0];
}

// The bound E of an edge axis, for edges of sizes a and b. The errors are at most
//   6 u reach a       in a product x cross e,
//   10 u reach a b    in its dot product with f,
//   22 u reach a b    in the difference of two dot products.
// The last two add up to 32 u reach a b; E is twice this bound.
TAUGUARD_INLINE double edge_error(double a, double b, double reach) {
  return 64 * unit * a * b * reach;
}

TAUGUARD_INLINE Verdict sat_tetrahedra(const double* a, const double* b) {
  const TetrahedronFacets fa(a), fb(b);
  double p[4][3], own[4][3], reach = 0.0, far = 0.0;
  Double4 top_a{}, top_b{};
  for (int j = 0; j < 4; ++j) {
    double q[3];
    for (int k = 0; k < 3; ++k) {
      p[j][k] = b[3 * j + k] - a[k];
      q[k] = a[3 * j + k] - b[k];
      own[j][k] = a[3 * j + k] - a[k];
    }
    reach = std::max(reach, norm1(p[j]));
    far = std::max(far, norm1(q));
    top_a = j == 0 ? fa.at(p[0]) : max(top_a, fa.at(p[j]));
    top_b = j == 0 ? fb.at(q) : max(top_b, fb.at(q));
  }
  if (!in_range(fa.size) || !in_range(fb.size) || !in_range(reach) || !in_range(far))
    return undecided;
  const double ea = tetrahedron_error(fa.size, reach), eb = tetrahedron_error(fb.size, far);
  if (any((top_a < -ea) | (top_b < -eb))) return separated;
  bool certain = all((fa.determinant > ea) & (fb.determinant > eb) & (top_a > ea) & (top_b > eb));

  constexpr int edges[6][4] = {{0, 1, 2, 3}, {0, 2, 1, 3}, {0, 3, 1, 2},
                               {1, 2, 0, 3}, {1, 3, 0, 2}, {2, 3, 0, 1}};
  const TetrahedronEdges f(b);
  const double ee = edge_error(2 * fa.size, 2 * fb.size, reach + fa.size);
  for (const auto& edge : edges) {
    double e[3], base[3], u[3], v[3], uc[3], vc[3];
    for (int k = 0; k < 3; ++k) {
      base[k] = own[edge[0]][k];
      e[k] = a[3 * edge[1] + k] - a[3 * edge[0] + k];
      u[k] = own[edge[2]][k] - base[k];
      v[k] = own[edge[3]][k] - base[k];
    }
    cross(u, e, uc), cross(v, e, vc);
    Double4 c[3], low, high;
    cross_with(p, e, c);
    double at_base[3];
    cross(base, e, at_base);
    for (int k = 0; k < 3; ++k) c[k] -= at_base[k];
    for (int group = 0; group < 2; ++group) {
      f.range(group, c, low, high);
      const Double4 x = f.dot(group, uc), y = f.dot(group, vc);
      const Double4 own_low = min(splat(0.0), min(x, y)), own_high = max(splat(0.0), max(x, y));
      const Double4 gap = max(low - own_high, own_low - high);
      if (any(gap > ee)) return separated;
      certain = certain && all(gap < -ee);
    }
  }
  return certain ? common : undecided;
}

TAUGUARD_INLINE Verdict sat_zonotope_tetrahedron(const Zonotope& a, const double* b) {
  const Slabs sa(a);
  const TetrahedronFacets fb(b);
  double p[4][3], q[3], reach = 0.0, far = 0.0;
  for (int j = 0; j < 4; ++j) {
    double from_origin[3];
    for (int k = 0; k < 3; ++k) {
      from_origin[k] = b[3 * j + k] - a.origin[k];
      p[j][k] = from_origin[k] - a.shift[k];
    }
    reach = std::max(reach, norm1(from_origin));
  }
  for (int k = 0; k < 3; ++k) {
    q[k] = a.origin[k] - b[k];
    far += std::fabs(q[k]);
    q[k] += a.shift[k];
  }
  reach += 3 * sa.size;
  if (!in_range(sa.size) || !in_range(fb.size) || !in_range(reach)) return undecided;
  const double ea = 32 * unit * sa.size * sa.size * reach, wall = sa.determinant;
  Double4 top = sa.at(p[0]), bottom = top;
  for (int j = 1; j < 4; ++j) {
    const Double4 x = sa.at(p[j]);
    top = max(top, x);
    bottom = min(bottom, x);
  }
  if (any((bottom > wall + ea) | (top < -wall - ea))) return separated;
  Double4 column = fb.at(q);
  for (const auto& g : a.g) column += abs(fb.n[0] * g[0] + fb.n[1] * g[1] + fb.n[2] * g[2]);
  const double eb = tetrahedron_error(fb.size, far + 6 * sa.size);
  if (any(column < -eb)) return separated;
  bool certain = wall > ea && all(fb.determinant > eb) && all(column > eb) &&
                 all(bottom < wall - ea) && all(top > ea - wall);

  const TetrahedronEdges f(b);
  const double ee = edge_error(sa.size, 2 * fb.size, reach);
  for (int i = 0; i < 3; ++i) {
    const double* e = a.g[i];
    double uc[3], vc[3];
    cross(a.g[(i + 1) % 3], e, uc), cross(a.g[(i + 2) % 3], e, vc);
    Double4 c[3], low, high;
    cross_with(p, e, c);
    for (int group = 0; group < 2; ++group) {
      f.range(group, c, low, high);
      const Double4 radius = abs(f.dot(group, uc)) + abs(f.dot(group, vc));
      const Double4 gap = max(low - radius, -radius - high);
      if (any(gap > ee)) return separated;
      certain = certain && all(gap < -ee);
    }
  }
  return certain ? common : undecided;
}

TAUGUARD_INLINE Verdict sat_zonotopes(const Zonotope& a, const Zonotope& b) {
  const Slabs sa(a), sb(b);
  double d[3], w = 0.0;
  for (int k = 0; k < 3; ++k) {
    d[k] = b.origin[k] - a.origin[k];
    w += std::fabs(d[k]);
    d[k] += b.shift[k] - a.shift[k];
  }
  w += 3 * (sa.size + sb.size);
  if (!in_range(sa.size) || !in_range(sb.size) || !in_range(w)) return undecided;
  const double ea = 64 * unit * sa.size * sa.size * w, eb = 64 * unit * sb.size * sb.size * w;
  Double4 gap_a = abs(sa.at(d)) - sa.determinant, gap_b = abs(sb.at(d)) - sb.determinant;
  for (int i = 0; i < 3; ++i) {
    gap_a -= abs(sa.at(b.g[i]));
    gap_b -= abs(sb.at(a.g[i]));
  }
  if (any((gap_a > ea) | (gap_b > eb))) return separated;
  bool certain = all(gap_a < -ea) && all(gap_b < -eb);

  Double4 f[3];  // B's generators, the third twice
  for (int k = 0; k < 3; ++k) f[k] = Double4{b.g[0][k], b.g[1][k], b.g[2][k], b.g[2][k]};
  const auto along = [&](const double* x) __attribute__((always_inline)) {
    return abs(f[0] * x[0] + f[1] * x[1] + f[2] * x[2]);
  };
  const double ee = edge_error(sa.size, sb.size, w);
  for (int i = 0; i < 3; ++i) {
    const double* e = a.g[i];
    double dc[3], uc[3], vc[3], gc[3];
    cross(d, e, dc), cross(a.g[(i + 1) % 3], e, uc), cross(a.g[(i + 2) % 3], e, vc);
    Double4 gap = along(dc) - along(uc) - along(vc);
    for (const auto& g : b.g) {
      cross(g, e, gc);
      gap -= along(gc);
    }
    if (any(gap > ee)) return separated;
    certain = certain && all(gap < -ee);
  }
  return certain ? common : undecided;
}

}  // namespace tauguard::rigid
