// A query is decided by cutting [0, 1] into intervals of time and testing them, earliest first.
// * An interval is clear (without contact) if the coplanarity cubic has Bernstein coefficients of
//   one sign on it, or if one direction separates the features at both ends. The differences are
//   linear in time, so the direction also separates them in between.
// * If the cubic changes its sign, its root is enclosed in a tiny interval.
// * An interval of width 2^-34 that is not clear is a contact at its start if the signs prove this
//   in spite of rounding. Otherwise exact arithmetic decides.
// So no contact is missed, none is false, and no time is late.
#include "intervals.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tauguard::cloth {
namespace {

// Whether the direction m separates the features by more than the minimum distance at times a and
// b: all gaps along m have the same sign. Rounding errors in units of |m|_1 big: u of a difference,
// 3 u of a dot product, 6 u of the interpolation. Together they are 10 u; the bound is 16 u.
bool separated(const Query& k, Vec3 m, double a, double b) {
  const double m1 = std::fabs(m.x) + std::fabs(m.y) + std::fabs(m.z);
  const double margin = 16 * unit_roundoff * m1 * k.big +
                        k.distance * std::sqrt(dot(m, m)) * (1 + 16 * unit_roundoff);
  bool above = true, below = true;
  for (int i = 0; i < k.gaps; ++i) {
    const double g0 = dot(m, k.gap[0][i]), g1 = dot(m, k.gap[1][i]);
    const double ga = g0 + a * (g1 - g0), gb = g0 + b * (g1 - g0);
    above = above && ga > margin && gb > margin;
    below = below && ga < -margin && gb < -margin;
  }
  return above || below;
}

// Whether the normal of the plane or a direction in the plane separates the features.
bool plane_direction(const Query& k, double t, double a, double b, bool vf) {
  const Vec3 q = mix(k.q[0], k.q[1], t), r = mix(k.r[0], k.r[1], t), n = cross(q, r);
  return separated(k, cross(n, q), a, b) || separated(k, cross(n, r), a, b) ||
         (vf && separated(k, cross(n, r - q), a, b)) || separated(k, n, a, b);
}
// Whether a direction between two vertices, or a vertex and an edge, separates the features.
bool edge_direction(const Query& k, double t, double a, double b) {
  const Vec3 q = mix(k.q[0], k.q[1], t), r = mix(k.r[0], k.r[1], t);
  for (int i = 0; i < k.gaps; ++i) {
    const Vec3 d = mix(k.gap[0][i], k.gap[1][i], t);
    if (separated(k, d, a, b)) return true;
    for (Vec3 e : {q, r}) {
      const double ee = dot(e, e);
      if (ee > 0 && separated(k, d - (dot(d, e) / ee) * e, a, b)) return true;
    }
  }
  return false;
}

bool same(Vec3 a, Vec3 b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
bool is_wire(const Query& k) { return same(k.q[0], k.r[0]) && same(k.q[1], k.r[1]); }

double determinant(const Query& k, double t) {
  return dot(mix(k.p[0], k.p[1], t), cross(mix(k.q[0], k.q[1], t), mix(k.r[0], k.r[1], t)));
}

// Whether there is certainly contact between times a and b, or within 2^-32 of them. The cubic
// changes its sign and thus has a root, and during the interval the origin is on the inner side of
// every edge of the hull of the gaps.
//
// Error bounds, with B = big:
// * The error of a component of `mix` is 6 u B: u B from the differences, 5 u B from interpolation.
// * The error of the determinant is at most 174 u B^3 < 2^-45 B^3.
// * A side (g x h) . n, with n = q x r, is at most 12 B^4. It changes by at most 96 B^4 per unit of
//   time, over half of the interval. Rounding adds less than 2^-43 B^4.
bool certain(const Query& k, double a, double b, bool vf) {
  a = std::max(0.0, a - 0x1p-32);
  b = std::min(1.0, b + 0x1p-32);
  const double error = 0x1p-45 * k.big * k.big * k.big, fa = determinant(k, a),
               fb = determinant(k, b);
  if (!((fa > error && fb < -error) || (fa < -error && fb > error))) return false;
  const double t = 0.5 * (a + b), big2 = k.big * k.big,
               margin = (64 * (b - a) + 0x1p-43) * big2 * big2;
  const Vec3 n = cross(mix(k.q[0], k.q[1], t), mix(k.r[0], k.r[1], t));
  Vec3 g[4];
  for (int i = 0; i < k.gaps; ++i) g[i] = mix(k.gap[0][i], k.gap[1][i], t);
  if (!vf) std::swap(g[2], g[3]);  // in order around the hull
  bool left = true, right = true;
  for (int i = 0; i < k.gaps; ++i) {
    const double side = dot(cross(g[i], g[i + 1 < k.gaps ? i + 1 : 0]), n);
    left = left && side > margin;
    right = right && side < -margin;
  }
  return left || right;
}

}  // namespace

double first_contact(const Query& k, bool vf, Stats& stats) {
  struct Piece {
    double a, b;
    Cubic c;
  };
  const double error = k.cubic_error();
  Piece stack[128];
  int top = 0;
  stack[top++] = {0, 1, cubic(k)};
  const double* c = stack[0].c.b;
  const bool flat =
      std::max({std::fabs(c[0]), std::fabs(c[1]), std::fabs(c[2]), std::fabs(c[3])}) < error;
  // Largest number of cuts. Features that stay in one plane go to exact arithmetic at once, except
  // faces that are an edge or a point: these are nearly always apart, so a few cuts are tried.
  const int most = k.distance > 0 ? 4000 : !flat ? 40 : vf && is_wire(k) ? 12 : 0;
  for (int count = 0; top > 0; ++count) {
    const Piece piece = stack[--top];
    ++stats.intervals;
    if (k.distance == 0 && one_sign(piece.c, error) != 0) continue;
    const double width = piece.b - piece.a, *b = piece.c.b;
    const bool crosses = k.distance == 0 && (b[0] > 0) != (b[3] > 0);
    double s = 0.5;
    {
      const double middle = 0.5 * (piece.a + piece.b);
      if (plane_direction(k, middle, piece.a, piece.b, vf)) continue;
      if (!(crosses && width > 0x1p-30) && edge_direction(k, middle, piece.a, piece.b)) continue;
    }
    if (width < 0x1p-34 || count > most || top > 120)
      return k.distance > 0 || (width < 0x1p-33 && certain(k, piece.a, piece.b, vf)) ? piece.a
                                                                                     : undecided;
    Piece left, right;
    if (crosses) {
      const double x = root(b), delta = 0x1p-37 / width;
      // The interval [x - delta, x + delta] around the root is small enough to be the result.
      const double lo = x - delta, hi = x + delta;
      if (lo > 0 && hi < 1) {
        Piece rest, near;
        halve(piece.c, lo, left.c, rest.c);
        halve(rest.c, (hi - lo) / (1 - lo), near.c, right.c);
        left.a = piece.a;
        left.b = near.a = piece.a + lo * width;
        near.b = right.a = piece.a + hi * width;
        right.b = piece.b;
        stack[top++] = right;
        stack[top++] = near;
        stack[top++] = left;
        continue;
      }
    }
    const double cut = piece.a + s * width;
    left.a = piece.a;
    left.b = cut;
    right.a = cut;
    right.b = piece.b;
    halve(piece.c, s, left.c, right.c);
    stack[top++] = right;
    stack[top++] = left;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace tauguard::cloth
