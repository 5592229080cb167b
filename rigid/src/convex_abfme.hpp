// Overlap of two convex bodies by eliminating the separating plane.
//
// A separating plane is a linear function f with f >= 0 on A and f < 0 on B. Write f = sum_i p_i
// F_i, where F_i are the facet functions of A, scaled by determinants so that nothing is divided.
// The unknowns are the weights p_i >= 0. Each vertex b_j of B gives one row of a table:
//   sum_i p_i F_i(b_j) < 0.
// For a zonotope B all rows are bounded at once, by the absolute values of the generators' terms.
// * A column that is all negative: F_i alone separates the bodies (a facet of A).
// * A row that is all positive: the vertex b_j is in A, and no plane separates the bodies.
// * Two columns i and k: eliminating p_k combines the rows of opposite sign and leaves an interval
//   for the ratio p_i / p_k. If it is not empty, a plane through the edge of A between the facets i
//   and k separates the bodies. Facets that share no edge give redundant pairs, which are left out.
// * Three columns: the planes that remain contain a facet of B. They are the columns of the table
//   with A and B exchanged.
// Bodies of full dimension need no other plane. So if each of these steps is certified to find no
// plane, the bodies share an interior point.
//
// Every entry has an error bound E, derived where the entry is computed (u = 2^-53). The sum of its
// terms is rounded up to a power of two, which also covers the rounding of E. Larger entries can
// only prevent a separation. So a separation that is found with all entries raised by E is certain,
// and overlap is certain if none is found with all entries lowered by E. Any other result is
// `undecided`. Bodies with sizes outside [1e-30, 1e30] are undecided, too: inside this range,
// products of up to nine lengths neither overflow nor lose relative accuracy.
#pragma once

#include <algorithm>

#include "convex_lanes.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

enum Verdict : std::int8_t { separated = -1, undecided = 0, common = 1 };

inline constexpr double unit = 0x1p-53;

TAUGUARD_INLINE bool in_range(double size) { return size >= 1e-30 && size <= 1e30; }
TAUGUARD_INLINE double norm1(const double* x) {
  return std::fabs(x[0]) + std::fabs(x[1]) + std::fabs(x[2]);
}
TAUGUARD_INLINE void cross(const double* x, const double* y, double* out) {
  out[0] = x[1] * y[2] - x[2] * y[1];
  out[1] = x[2] * y[0] - x[0] * y[2];
  out[2] = x[0] * y[1] - x[1] * y[0];
}
TAUGUARD_INLINE double dot(const double* x, const double* y) {
  return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}

// Loads four points relative to `origin`: x[k] is component k, with one point per lane.
TAUGUARD_INLINE void load_points(const double* v, const double* origin, Double4* x) {
  for (int k = 0; k < 3; ++k) x[k] = Double4{v[k], v[3 + k], v[6 + k], v[9 + k]} - origin[k];
}
// Writes four points relative to `origin` to the rows of p. Returns the largest 1-norm of a row.
TAUGUARD_INLINE double offsets_from(const double* v, const double* origin, double (*p)[3]) {
  double reach = 0.0;
  for (int j = 0; j < 4; ++j) {
    for (int k = 0; k < 3; ++k) p[j][k] = v[3 * j + k] - origin[k];
    reach = std::max(reach, norm1(p[j]));
  }
  return reach;
}

// Marks the lanes in which x_j + r y_j < 0 for all rows j and all r of some interval in r > 0. The
// rounding of r changes a row by u |y| r, which the slack in the callers' bound E covers.
template <int Rows = 4>
TAUGUARD_INLINE Mask4 leaves_interval(const Double4* x, const Double4* y) {
  Double4 low = splat(0.0), high = splat(HUGE_VAL);
  for (int j = 0; j < Rows; ++j) {
    const Double4 ratio = -x[j] / y[j];
    const Mask4 upper = y[j] >= 0.0;
    const Double4 h = upper ? ratio : splat(HUGE_VAL), l = upper ? splat(0.0) : ratio;
    high = min(h, high);
    low = max(l, low);
  }
  return low < high;
}

// The facet functions F = n . p - c of a tetrahedron, for points p relative to vertex 0. Lane i is
// zero on the facet opposite vertex i and positive at vertex i. F is negated if the determinant is
// negative; the sign is applied last, so that no other operation waits for the determinant.
struct TetrahedronFacets {
  Double4 n[3], c, determinant;
  Mask4 turned;  // the sign bit, in lanes whose normal points outwards
  double size;
  TAUGUARD_INLINE explicit TetrahedronFacets(const double* v) {
    Double4 x[3], e[3], f[3];
    load_points(v, v, x);
    size = largest(abs(x[0]) + abs(x[1]) + abs(x[2]));
    Double4 base[3];  // facet i has the vertices i + 1, i + 2, i + 3
    for (int k = 0; k < 3; ++k) {
      base[k] = turn1(x[k]);
      e[k] = turn2(x[k]) - base[k];
      f[k] = turn1(turn2(x[k])) - base[k];
    }
    for (int k = 0; k < 3; ++k) {
      const int l = k == 2 ? 0 : k + 1, m = 3 - k - l;
      n[k] = e[l] * f[m] - e[m] * f[l];
    }
    c = n[0] * base[0] + n[1] * base[1] + n[2] * base[2];
    determinant = n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - c;
    turned = (Mask4)determinant & INT64_MIN;
    determinant = (Double4)((Mask4)determinant ^ turned);
  }
  TAUGUARD_INLINE Double4 at(const double* p) const {
    return (Double4)((Mask4)(n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - c) ^ turned);
  }
};

// The bound E for a tetrahedron's table at points p - a0 whose 1-norm is at most `reach`, where a0
// is vertex 0. Let a be the largest 1-norm of a vertex relative to a0. The errors are at most
//   4 u a                        in an edge (at most 2 a),
//   24 u a^2                     in a component of a normal (at most 4 a^2),
//   (24 + 4 + 12) u a^2 reach    in n . p,
//   (24 + 4 + 12) u a^3          in c,
//   4 u a^2 (a + reach)          in the difference of n . p and c,
//   88 u a^3                     in the determinant, whose sign may be wrong.
// The rounding of an interval's ratio needs a slack of 8 u times an entry. The sum of all errors is
// at most 164 u a^2 (a + reach).
TAUGUARD_INLINE double tetrahedron_error(double a, double reach) {
  return 256 * unit * a * a * (a + reach);
}

TAUGUARD_INLINE Verdict abfme_tetrahedra(const double* a, const double* b) {
  const TetrahedronFacets fa(a);
  double p[4][3];
  const double reach = offsets_from(b, a, p);
  if (!in_range(fa.size) || !in_range(reach)) return undecided;
  const double ea = tetrahedron_error(fa.size, reach);
  Double4 row[4];
  for (int j = 0; j < 4; ++j) row[j] = fa.at(p[j]);
  const Double4 top_a = max(max(row[0], row[1]), max(row[2], row[3]));
  if (any(top_a < -ea)) return separated;

  const TetrahedronFacets fb(b);
  double q[4][3];
  const double far = offsets_from(a, b, q);
  if (!in_range(fb.size) || !in_range(far)) return undecided;
  const Double4 top_b = max(max(fb.at(q[0]), fb.at(q[1])), max(fb.at(q[2]), fb.at(q[3])));
  const double eb = tetrahedron_error(fb.size, far);
  if (any(top_b < -eb)) return separated;

  bool certain = all((fa.determinant > ea) & (fb.determinant > eb) & (top_a > ea) & (top_b > eb));
  Double4 x[4], y[4];
  for (int pass = 0; pass < 2; ++pass) {
    const auto open = [&](double shift) __attribute__((always_inline)) {
      for (int j = 0; j < 4; ++j) {
        x[j] = row[j] + shift;
        y[j] = pass == 0 ? turn1(x[j]) : turn2(x[j]);
      }
      return any(leaves_interval(x, y));
    };
    if (!open(-ea)) continue;
    if (open(ea)) return separated;
    certain = false;
  }
  return certain ? common : undecided;
}

// The slabs |n_i . (p - centre)| <= determinant of a zonotope with three generators. The normal n_i
// is the cross product of the other two generators. Slab i is in lane i < 3; lane 3 is zero.
struct Slabs {
  Double4 n[3];
  double determinant, size;
  TAUGUARD_INLINE explicit Slabs(const Zonotope& z) {
    double m[3][3];
    cross(z.g[1], z.g[2], m[0]), cross(z.g[2], z.g[0], m[1]), cross(z.g[0], z.g[1], m[2]);
    for (int k = 0; k < 3; ++k) n[k] = Double4{m[0][k], m[1][k], m[2][k], 0.0};
    determinant = std::fabs(dot(z.g[0], m[0]));
    size = std::max({norm1(z.g[0]), norm1(z.g[1]), norm1(z.g[2])});
  }
  TAUGUARD_INLINE Double4 at(const double* p) const {
    return n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
  }
};

// Zonotope A against tetrahedron B. A's table is computed at the points p_j = (b_j - origin) -
// shift. Let a be the size of A's generators and `reach` the 1-norm of b_j - origin plus 3 a. Then
// a <= reach / 3, and the errors are at most
//   3 u reach                      in a point,
//   4 u a^2                        in a normal,
//   (4 + 3 + 1 + 2) u a^2 reach    in an entry,
//   8 u a^3                        in the determinant,
// and one rounding of their sum: together 14 u a^2 reach. With the slack of 8 u, E is 32 u a^2
// reach. B's facet functions at A's centre have the error of tetrahedron_error(). Each of the three
// generators adds 20 u b^2 a, with b the size of B; adding 6 a to the reach covers this.
TAUGUARD_INLINE Verdict abfme_zonotope_tetrahedron(const Zonotope& a, const double* b) {
  const Slabs sa(a);
  Double4 p[3];  // one vertex of B per lane
  load_points(b, a.origin, p);
  const Double4 reach = abs(p[0]) + abs(p[1]) + abs(p[2]) + 3 * sa.size;
  for (int k = 0; k < 3; ++k) p[k] -= a.shift[k];
  if (!in_range(sa.size) || !all((reach >= 1e-30) & (reach <= 1e30))) return undecided;
  const Double4 ea = 32 * unit * sa.size * sa.size * reach;  // for the entries of each vertex
  const double wall = sa.determinant;
  Double4 row[3];  // slab i at the vertices
  for (int i = 0; i < 3; ++i) row[i] = sa.n[0][i] * p[0] + sa.n[1][i] * p[1] + sa.n[2][i] * p[2];
  bool beyond = false;
  for (const auto& r : row) beyond = beyond | all(r > wall + ea) | all(r < -wall - ea);
  if (beyond) return separated;

  const TetrahedronFacets fb(b);
  if (!in_range(fb.size)) return undecided;
  double q[3], far = 0.0;
  for (int k = 0; k < 3; ++k) {
    q[k] = a.origin[k] - b[k];
    far += std::fabs(q[k]);
    q[k] += a.shift[k];
  }
  Double4 column = fb.at(q);
  for (int i = 0; i < 3; ++i)
    column += abs(fb.n[0] * a.g[i][0] + fb.n[1] * a.g[i][1] + fb.n[2] * a.g[i][2]);
  const double eb = tetrahedron_error(fb.size, far + 6 * sa.size);
  if (any(column < -eb)) return separated;
  if (any(max(abs(row[0]), max(abs(row[1]), abs(row[2]))) < wall - ea)) return common;

  bool certain = all(wall > ea) && all(fb.determinant > eb) && all(column > eb);
  for (const auto& r : row) certain = certain && any(r < wall - ea) && any(r > ea - wall);
  const Double4 side_x{1.0, 1.0, -1.0, -1.0}, side_y{1.0, -1.0, 1.0, -1.0};
  Double4 x[4], y[4];
  for (int i = 0; i < 3; ++i) {  // the four edges of A along generator i + 2, one per lane
    const int k = i == 2 ? 0 : i + 1;
    const auto open = [&](const Double4& shift) __attribute__((always_inline)) {
      for (int j = 0; j < 4; ++j) {
        x[j] = wall - side_x * row[i][j] + shift[j];
        y[j] = wall - side_y * row[k][j] + shift[j];
      }
      return any(leaves_interval(x, y));
    };
    if (!open(-ea)) continue;
    if (open(ea)) return separated;
    certain = false;
  }
  return certain ? common : undecided;
}

// Two zonotopes with generators of sizes a and b. A's slab normals n_i are multiplied by B's
// generators, C_k = n_i . g_k (lane i), and by the offset of the centres, which gives m. The length
// w = |origin_b - origin_a|_1 + 3 (a + b) bounds every length. The offset's error is at most 4 u w.
//
// Facets. The errors are at most
//   11 u a^2 w    in m,
//   8 u a^3       in the determinant,
//   8 u a^2 b     in each of three entries,
//   8 u a^2 w     in four sums,
// together 32 u a^2 w; E is twice this bound. Edges. Products of two such entries occur, with |C|
// <= a^2 b. In units of u a^4 b w the errors are 42 in the offset's minor, 12 in the determinant's
// terms, 24 in the generators' minors and 20 in the sums, together 98; E is 128 u a^4 b w.
TAUGUARD_INLINE Verdict abfme_zonotopes(const Zonotope& a, const Zonotope& b) {
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

  const Double4 m = sa.at(d), c[3] = {sa.at(b.g[0]), sa.at(b.g[1]), sa.at(b.g[2])};
  const Double4 gap_a = abs(m) - sa.determinant - abs(c[0]) - abs(c[1]) - abs(c[2]);
  const Double4 gap_b =
      abs(sb.at(d)) - sb.determinant - abs(sb.at(a.g[0])) - abs(sb.at(a.g[1])) - abs(sb.at(a.g[2]));
  if (any((gap_a > ea) | (gap_b > eb))) return separated;

  bool certain = all(gap_a < -ea) && all(gap_b < -eb);
  const double ee = 128 * unit * sa.size * sa.size * sa.size * sa.size * sb.size * w;
  const Double4 m1 = next3(m), c1[3] = {next3(c[0]), next3(c[1]), next3(c[2])};
  const auto minor = [&](int l, Double4 x, Double4 x1)
                         __attribute__((always_inline)) { return abs(c[l] * x1 - c1[l] * x); };
  const Double4 m01 = minor(0, c[1], c1[1]), m12 = minor(1, c[2], c1[2]),
                m20 = minor(2, c[0], c1[0]);
  const Double4 others[3] = {m01 + m20, m01 + m12, m12 + m20};
  Double4 worst;
  for (int l = 0; l < 3; ++l) {
    Double4 gap = minor(l, m, m1) - sa.determinant * (abs(c[l]) + abs(c1[l])) - others[l];
    gap[3] = gap[0];  // the fourth lane of a triple of generators
    worst = l == 0 ? gap : max(worst, gap);
  }
  if (any(worst > ee)) return separated;
  return certain && all(worst < -ee) ? common : undecided;
}

}  // namespace tauguard::rigid
