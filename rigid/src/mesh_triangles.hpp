// Whether two closed triangles share a point. Exact for any finite doubles, also for degenerate
// triangles (a collinear triangle is a segment, three equal corners are a point).
//
// In general position the interval test of Guigue and Devillers decides ("Fast and robust
// triangle-triangle overlap test using orientation predicates", 2003). If an orientation is zero,
// tests of edges against triangles decide, which are valid in any position.
#pragma once

#include <algorithm>
#include <utility>

#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/signs.hpp"

namespace tauguard::rigid {

using geometry::orient2d;
using geometry::orient3d;

struct Triangle {
  double v[3][3];
};

namespace exact {

// The two coordinates of a point that remain when axis k is dropped.
struct Flat {
  double p[2];
  Flat(const double* x, int k) : p{x[(k + 1) % 3], x[(k + 2) % 3]} {}
};

inline int turn(const double* a, const double* b, const double* c, int k) {
  return orient2d(Flat(a, k).p, Flat(b, k).p, Flat(c, k).p);
}

// An axis along which a, b, c project to a proper triangle; -1 if they are collinear.
inline int dropped_axis(const double* a, const double* b, const double* c) {
  for (int k = 0; k < 3; ++k)
    if (turn(a, b, c, k) != 0) return k;
  return -1;
}

// Whether p is on the closed segment ab, for collinear a, b, p. On a line, points are ordered by
// their coordinates in lexicographic order.
inline bool between(const double* a, const double* b, const double* p) {
  const bool forward = std::lexicographical_compare(a, a + 3, b, b + 3);
  const double *lo = forward ? a : b, *hi = forward ? b : a;
  return !std::lexicographical_compare(p, p + 3, lo, lo + 3) &&
         !std::lexicographical_compare(hi, hi + 3, p, p + 3);
}

inline bool on_segment(const double* a, const double* b, const double* p) {
  return dropped_axis(a, b, p) < 0 && between(a, b, p);
}

// Whether the closed segments pq and ab meet in space.
inline bool segments_meet(const double* p, const double* q, const double* a, const double* b) {
  if (on_segment(a, b, p) || on_segment(a, b, q) || on_segment(p, q, a) || on_segment(p, q, b))
    return true;
  if (orient3d(p, q, a, b) != 0) return false;
  int k = dropped_axis(p, q, a);
  if (k < 0) k = dropped_axis(p, q, b);
  if (k < 0) return false;  // all collinear, and no end lies on the other segment
  return turn(p, q, a, k) * turn(p, q, b, k) < 0 && turn(a, b, p, k) * turn(a, b, q, k) < 0;
}

// Whether p is in the non-degenerate triangle t, whose plane contains p, seen along axis k.
inline bool inside_flat(const double* p, const Triangle& t, int k) {
  const int s = turn(t.v[0], t.v[1], t.v[2], k);
  for (int i = 0; i < 3; ++i)
    if (turn(t.v[i], t.v[(i + 1) % 3], p, k) * s < 0) return false;
  return true;
}

inline bool meets_an_edge(const double* p, const double* q, const Triangle& t) {
  for (int i = 0; i < 3; ++i)
    if (segments_meet(p, q, t.v[i], t.v[(i + 1) % 3])) return true;
  return false;
}

// Whether the closed segment pq (p == q allowed) meets the closed triangle t (collinear allowed).
inline bool segment_meets(const double* p, const double* q, const Triangle& t) {
  const int k = dropped_axis(t.v[0], t.v[1], t.v[2]);
  if (k < 0) return meets_an_edge(p, q, t);
  const int sp = orient3d(t.v[0], t.v[1], t.v[2], p), sq = orient3d(t.v[0], t.v[1], t.v[2], q);
  if (sp * sq > 0) return false;
  if (sp == 0 && sq == 0)
    return inside_flat(p, t, k) || inside_flat(q, t, k) || meets_an_edge(p, q, t);
  if (sp == 0) return inside_flat(p, t, k);
  if (sq == 0) return inside_flat(q, t, k);
  int lo = 0, hi = 0;
  for (int i = 0; i < 3; ++i) {
    const int s = orient3d(p, q, t.v[i], t.v[(i + 1) % 3]);
    lo = std::min(lo, s);
    hi = std::max(hi, s);
  }
  return lo == 0 || hi == 0;
}

// Two closed triangles meet if and only if an edge of one meets the other.
inline bool triangles_meet(const Triangle& a, const Triangle& b) {
  for (int i = 0; i < 3; ++i)
    if (segment_meets(a.v[i], a.v[(i + 1) % 3], b) || segment_meets(b.v[i], b.v[(i + 1) % 3], a))
      return true;
  return false;
}

}  // namespace exact

// Signs of q's corners against p's plane, as orient3d, but with p's normal computed once.
inline void plane_signs(const Triangle& p, const Triangle& q, int* sign) {
  using geometry::unit_roundoff;
  const double ux = p.v[1][0] - p.v[0][0], uy = p.v[1][1] - p.v[0][1], uz = p.v[1][2] - p.v[0][2];
  const double vx = p.v[2][0] - p.v[0][0], vy = p.v[2][1] - p.v[0][1], vz = p.v[2][2] - p.v[0][2];
  const double yz = uy * vz, zy = uz * vy, zx = uz * vx, xz = ux * vz, xy = ux * vy, yx = uy * vx;
  const double nx = yz - zy, ny = zx - xz, nz = xy - yx;
  const double mx = std::fabs(yz) + std::fabs(zy), my = std::fabs(zx) + std::fabs(xz),
               mz = std::fabs(xy) + std::fabs(yx);
  for (int i = 0; i < 3; ++i) {
    const double wx = q.v[i][0] - p.v[0][0], wy = q.v[i][1] - p.v[0][1], wz = q.v[i][2] - p.v[0][2];
    const double det = nx * wx + ny * wy + nz * wz;
    const double permanent = mx * std::fabs(wx) + my * std::fabs(wy) + mz * std::fabs(wz);
    if (permanent > 1e-250 && permanent < 1e300 && std::fabs(det) > 16 * unit_roundoff * permanent)
      sign[i] = det > 0 ? 1 : -1;
    else
      sign[i] = orient3d(p.v[0], p.v[1], p.v[2], q.v[i]);
  }
}

// The corner that is alone on its side of the other triangle's plane. Requires that no sign is 0
// and that two signs differ.
inline int lonely(const int* s) { return s[0] == s[1] ? 2 : (s[0] == s[2] ? 1 : 0); }

// Whether the closed triangles a and b share a point, exactly. Needs RoundToNearest.
inline bool triangles_overlap(const Triangle& a, const Triangle& b) {
  int sb[3], sa[3];
  plane_signs(a, b, sb);
  if (sb[0] == sb[1] && sb[1] == sb[2] && sb[0] != 0) return false;
  plane_signs(b, a, sa);
  if (sa[0] == sa[1] && sa[1] == sa[2] && sa[0] != 0) return false;
  if (!(sa[0] && sa[1] && sa[2] && sb[0] && sb[1] && sb[2])) return exact::triangles_meet(a, b);
  // p is the lonely corner; q and r are ordered as if p were on the positive side of the plane.
  const int i = lonely(sa), j = lonely(sb);
  const double *p1 = a.v[i], *q1 = a.v[(i + 1) % 3], *r1 = a.v[(i + 2) % 3];
  const double *p2 = b.v[j], *q2 = b.v[(j + 1) % 3], *r2 = b.v[(j + 2) % 3];
  if (sa[i] < 0) std::swap(q2, r2);
  if (sb[j] < 0) std::swap(q1, r1);
  return orient3d(p1, q1, p2, q2) <= 0 && orient3d(p1, r1, r2, p2) <= 0;
}

}  // namespace tauguard::rigid
