// The point of a convex set of differences b - a that is nearest to the origin (Gilbert, Johnson
// and Keerthi 1988). `Source` identifies the two points of a difference: a row of each vertex list,
// or a point of each shape.
#pragma once

#include <algorithm>

#include "tauguard/geometry/lanes.hpp"
#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

using geometry::Double4;
using geometry::Mask4;
using geometry::splat;
using geometry::store4;
using geometry::Vec3x4;

// A corner of the simplex, and its weight in the nearest point.
template <class Source>
struct Corner {
  Vec3 w;  // b - a
  Source from;
  double weight;
};

template <class Source>
class Simplex {
 public:
  explicit Simplex(const Corner<Source>& first)
      : c_{first, first, first, first}, m_(1), nearest_(first.w) {}

  int size() const { return m_; }
  const Corner<Source>& corner(int i) const { return c_[i]; }
  const Vec3& w(int i) const { return c_[i].w; }
  const Vec3& nearest() const { return nearest_; }
  bool holds(const Vec3& w) const {
    return std::any_of(c_, c_ + m_, [&](const Corner<Source>& c) { return c.w == w; });
  }
  // Adds a corner and reduces the simplex to the face nearest to the origin among those with this
  // corner. If that face is no nearer than the simplex, nothing changes; returns false.
  TAUGUARD_INLINE bool add(const Corner<Source>& next) {
    c_[m_] = next;
    // Bit i of a number of a face: the face has the old corner i.
    double square[8];
    Faces edges, triangles;
    square[0] = dot(next.w, next.w);
    weigh(&edges, &triangles);
    square[1] = edges.square[0], square[2] = edges.square[1], square[4] = edges.square[2];
    square[3] = triangles.square[0], square[5] = triangles.square[1];
    square[6] = triangles.square[2];
    double l[4] = {1, 0, 0, 0};
    Vec3 p = next.w;
    square[7] = m_ == 3 ? inside(l, &p) : INFINITY;
    double best = dot(nearest_, nearest_);
    int kept = -1;
    for (int face = 0; face < 1 << m_; ++face)
      if (square[face] < best) best = square[face], kept = face;
    if (kept < 0) return false;
    if (kept != 7) {
      constexpr int lane[7] = {0, 0, 1, 0, 2, 1, 2};
      const Faces& f = kept == 3 || kept > 4 ? triangles : edges;
      const int i = lane[kept];
      l[1] = kept ? f.weight[0][i] : 0, l[2] = f.weight[1][i], l[0] = 1 - l[1] - l[2];
      p = kept ? Vec3{f.x[i], f.y[i], f.z[i]} : next.w;
    }
    nearest_ = p;
    int size = 0;
    for (int i = 0; i <= m_; ++i)
      if ((kept | 1 << m_) >> i & 1) c_[size] = c_[i], c_[size].weight = l[size], ++size;
    m_ = size;
    return true;
  }

 private:
  // Of faces in lanes: the points nearest to the origin in their planes or lines, the weights of
  // the second and third corners there, and the squares of the distances. A square is infinite if
  // corners are affinely dependent or the point is outside the face.
  struct Faces {
    double square[4], weight[2][4], x[4], y[4], z[4];
    TAUGUARD_INLINE void set(const Vec3x4& p, Double4 first, Double4 second, Mask4 regular) {
      const Mask4 known = regular & (first >= 0) & (second >= 0) & (1 - first - second >= 0);
      store4(square, known ? dot(p, p) : splat(INFINITY));
      store4(weight[0], first), store4(weight[1], second);
      store4(x, p.x), store4(y, p.y), store4(z, p.z);
    }
  };

  // Edges of the new corner to the old corners 0, 1 and 2, and its triangles with 0 and 1, 0 and 2,
  // 1 and 2. The point is a sum of offsets: less cancellation than a sum of weighted corners.
  TAUGUARD_INLINE void weigh(Faces* edges, Faces* triangles) const {
    const Vec3 &n = c_[m_].w, &p = c_[0].w, &q = c_[1].w, &r = c_[std::min(2, m_)].w;
    const Vec3x4 w = {{p.x, q.x, r.x, r.x}, {p.y, q.y, r.y, r.y}, {p.z, q.z, r.z, r.z}};
    const Vec3x4 e = Vec3x4{splat(n.x), splat(n.y), splat(n.z)} - w;
    const Double4 ee = dot(e, e), x = -dot(e, w), l = x / ee;
    edges->set(w + l * e, l, Double4{}, ee > 0);
    const Vec3x4 v = first(w), a = {second(w.x) - v.x, second(w.y) - v.y, second(w.z) - v.z};
    const Vec3x4 b = first(e);
    const Double4 aa = dot(a, a), ab = dot(a, b), bb = first(ee), xa = -dot(a, v), xb = first(x);
    const Double4 det = aa * bb - ab * ab, s = (xa * bb - xb * ab) / det,
                  t = (xb * aa - xa * ab) / det;
    triangles->set(v + s * a + t * b, s, t, det > 1e-24 * aa * bb);
  }
  static TAUGUARD_INLINE Double4 first(Double4 x) {
    return __builtin_shufflevector(x, x, 0, 0, 1, 1);
  }
  static TAUGUARD_INLINE Double4 second(Double4 x) {
    return __builtin_shufflevector(x, x, 1, 2, 2, 2);
  }
  static TAUGUARD_INLINE Vec3x4 first(const Vec3x4& v) {
    return {first(v.x), first(v.y), first(v.z)};
  }

  // Writes the weights of the origin in the tetrahedron of all corners, and their sum of corners;
  // returns its square, infinite as above.
  double inside(double* l, Vec3* p) const {
    const Vec3 &w = c_[0].w, e = c_[1].w - w, f = c_[2].w - w, g = c_[3].w - w, o = -1.0 * w;
    const Vec3 fg = cross(f, g);
    const double det = dot(e, fg);
    l[1] = dot(o, fg) / det, l[2] = dot(e, cross(o, g)) / det, l[3] = dot(e, cross(f, o)) / det;
    l[0] = 1 - l[1] - l[2] - l[3];
    if (!(*std::min_element(l, l + 4) >= 0)) return INFINITY;
    if (!(std::fabs(det) > 1e-14 * norm(e) * norm(f) * norm(g))) return INFINITY;
    *p = w + l[1] * e + l[2] * f + l[3] * g;
    return dot(*p, *p);
  }

  Corner<Source> c_[4];
  int m_;
  Vec3 nearest_;
};

// Descends from a first corner until the nearest point is found or rounding prevents progress.
// support(v) is the corner furthest along -v. The descent calls watch.visit before each step,
// watch.enough to decide whether to end, and watch.stuck if a new corner brings the simplex no
// nearer. A simplex of four corners contains the origin.
template <class Source, class Support, class Watch>
Simplex<Source> descend(const Corner<Source>& first, const Support& support, Watch& watch,
                        double square_of_zero) {
  Simplex<Source> s(first);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Vec3 v = s.nearest();
    watch.visit(s);
    if (s.size() == 4 || !(dot(v, v) > square_of_zero)) break;
    const Corner<Source> next = support(v);
    if (watch.enough(v, next.w) || s.holds(next.w)) break;
    if (s.add(next)) continue;
    watch.stuck(s, next.w);
    break;
  }
  return s;
}

}  // namespace tauguard::rigid
