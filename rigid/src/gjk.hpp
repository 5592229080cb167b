// The point of a convex set of differences b - a that is nearest to the origin (Gilbert, Johnson
// and Keerthi 1988). `Source` identifies the two points of a difference: a row of each vertex list,
// or a point of each shape.
#pragma once

#include <algorithm>

#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// A corner of the simplex, and its weight in the nearest point.
template <class Source>
struct Corner {
  Vec3 w;  // b - a
  Source from;
  double weight;
};

// The weights of the point nearest to the origin in the affine hull of the corners c[0], ...,
// c[m - 1]. False if the corners are affinely dependent or the point is outside their simplex.
template <class Source>
bool weigh(const Corner<Source>* const* c, int m, double* l) {
  l[0] = 1;
  if (m == 1) return true;
  const Vec3& w = c[0]->w;
  const Vec3 e[3] = {c[1]->w - w, m > 2 ? c[2]->w - w : Vec3{}, m > 3 ? c[3]->w - w : Vec3{}};
  if (m == 2) {
    const double ee = dot(e[0], e[0]);
    if (!(ee > 0)) return false;
    l[1] = -dot(e[0], w) / ee;
  } else if (m == 3) {
    const double aa = dot(e[0], e[0]), ab = dot(e[0], e[1]), bb = dot(e[1], e[1]);
    const double det = aa * bb - ab * ab, x = -dot(e[0], w), y = -dot(e[1], w);
    if (!(det > 1e-24 * aa * bb)) return false;
    l[1] = (x * bb - y * ab) / det, l[2] = (y * aa - x * ab) / det;
  } else {
    const double det = dot(e[0], cross(e[1], e[2]));
    if (!(std::fabs(det) > 1e-14 * norm(e[0]) * norm(e[1]) * norm(e[2]))) return false;
    const Vec3 o = -1.0 * w;
    l[1] = dot(o, cross(e[1], e[2])) / det;
    l[2] = dot(e[0], cross(o, e[2])) / det;
    l[3] = dot(e[0], cross(e[1], o)) / det;
  }
  for (int i = 1; i < m; ++i) l[0] -= l[i];
  return *std::min_element(l, l + m) >= 0;
}

template <class Source>
class Simplex {
 public:
  explicit Simplex(const Corner<Source>& first) : c_{first}, m_(1), nearest_(first.w) {}

  int size() const { return m_; }
  const Corner<Source>& corner(int i) const { return c_[i]; }
  const Vec3& w(int i) const { return c_[i].w; }
  const Vec3& nearest() const { return nearest_; }
  bool holds(const Vec3& w) const {
    return std::any_of(c_, c_ + m_, [&](const Corner<Source>& c) { return c.w == w; });
  }
  // Adds a corner and reduces the simplex to the face nearest to the origin among those with this
  // corner. If that face is no nearer than the simplex, nothing changes; returns false.
  bool add(const Corner<Source>& next) {
    c_[m_] = next;
    double best = dot(nearest_, nearest_), weight[4] = {};
    int kept = 0;
    for (int mask = 1 << m_; mask < 2 << m_; ++mask) {
      const Corner<Source>* face[4];
      double l[4];
      int size = 0;
      for (int i = 0; i <= m_; ++i)
        if (mask >> i & 1) face[size++] = &c_[i];
      if (!weigh(face, size, l)) continue;
      Vec3 p = face[0]->w;  // sum of offsets: less cancellation than a sum of weighted corners
      for (int i = 1; i < size; ++i) p += l[i] * (face[i]->w - face[0]->w);
      if (dot(p, p) < best)
        best = dot(p, p), kept = mask, nearest_ = p, std::copy(l, l + size, weight);
    }
    if (!kept) return false;
    int size = 0;
    for (int i = 0; i <= m_; ++i)
      if (kept >> i & 1) c_[size] = c_[i], c_[size].weight = weight[size], ++size;
    m_ = size;
    return true;
  }

 private:
  Corner<Source> c_[5];
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
