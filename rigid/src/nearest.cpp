// Gilbert, Johnson and Keerthi 1988 on the differences b - a of two point sets.
#include "nearest.hpp"

#include <algorithm>

namespace tauguard::rigid {
namespace {

// A corner of the simplex: the difference and the rows it comes from; its weight in the nearest
// point.
struct Corner {
  Vec w;
  std::array<std::size_t, 2> pair;
  double weight;
};

// The weights of the point nearest to the origin in the affine hull of c[0..m); false where the
// corners are dependent or the point lies outside.
bool weigh(const Corner* c, int m, double* l) {
  l[0] = 1;
  if (m == 1) return true;
  const Vec& w = c[0].w;
  const Vec e[3] = {c[1].w - w, m > 2 ? c[2].w - w : Vec{}, m > 3 ? c[3].w - w : Vec{}};
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
    const Vec o = -1.0 * w;
    l[1] = dot(o, cross(e[1], e[2])) / det;
    l[2] = dot(e[0], cross(o, e[2])) / det;
    l[3] = dot(e[0], cross(e[1], o)) / det;
  }
  for (int i = 1; i < m; ++i) l[0] -= l[i];
  return *std::min_element(l, l + m) >= 0;
}

class Simplex {
 public:
  explicit Simplex(const Vec& w) : c_{{w, {0, 0}, 1.0}}, m_(1), nearest_(w) {}

  int size() const { return m_; }
  const Vec& w(int i) const { return c_[i].w; }
  const Vec& nearest() const { return nearest_; }
  bool holds(const Vec& w) const {
    return std::any_of(c_, c_ + m_, [&](const Corner& c) { return c.w == w; });
  }
  Nearest of(const std::vector<Vec>& a, const std::vector<Vec>& b) const {
    Nearest out{{}, {}, m_, {}};
    for (int i = 0; i < m_; ++i) {
      out.a = out.a + c_[i].weight * a[c_[i].pair[0]];
      out.b = out.b + c_[i].weight * b[c_[i].pair[1]];
      out.corner[i] = c_[i].pair;
    }
    return out;
  }
  // Takes w in and keeps the face nearest to the origin among those that hold it; false, and no
  // change to what was kept, where that is no nearer.
  bool add(const Vec& w, std::size_t i, std::size_t j) {
    c_[m_] = {w, {i, j}, 0};
    double best = dot(nearest_, nearest_), weight[4] = {};
    int kept = 0;
    for (int mask = 1 << m_; mask < 2 << m_; ++mask) {
      Corner face[4];
      double l[4];
      int size = 0;
      for (int i = 0; i <= m_; ++i)
        if (mask >> i & 1) face[size++] = c_[i];
      if (!weigh(face, size, l)) continue;
      Vec p = face[0].w;  // as an offset: a sum of weighted corners would cancel
      for (int i = 1; i < size; ++i) p = p + l[i] * (face[i].w - face[0].w);
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
  Corner c_[5];
  int m_;
  Vec nearest_;
};

// The first row that is furthest along n.
std::size_t extreme(const std::vector<Vec>& points, const Vec& n) {
  std::size_t best = 0;
  double most = dot(n, points[0]);
  for (std::size_t i = 1; i < points.size(); ++i) {
    const double x = dot(n, points[i]);
    if (most < x) most = x, best = i;
  }
  return best;
}

// Runs until the nearest point is found or rounding stops the descent. `attempt` sees the
// directions on the way.
template <class Attempt>
Simplex descend(const std::vector<Vec>& a, const std::vector<Vec>& b, Attempt attempt) {
  Simplex s(b[0] - a[0]);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Vec v = s.nearest();
    attempt(v);
    if (s.size() == 3) attempt(cross(s.w(1) - s.w(0), s.w(2) - s.w(0)));
    if (s.size() == 4 || !(dot(v, v) > 0)) break;
    const std::size_t far_a = extreme(a, v), far_b = extreme(b, -1.0 * v);
    const Vec next = b[far_b] - a[far_a];
    if (dot(v, v) - dot(v, next) <= 1e-14 * dot(v, v) || s.holds(next)) break;
    const int size = s.size() + 1;
    const Vec all[4] = {s.w(0), size > 2 ? s.w(1) : next, size > 3 ? s.w(2) : next, next};
    if (s.add(next, far_a, far_b)) continue;
    for (int skip = 0; size == 4 && skip < 4; ++skip)
      attempt(cross(all[(skip + 1) % 4] - all[skip], all[(skip + 2) % 4] - all[skip]));
    if (size == 3) attempt(cross(all[1] - all[0], all[2] - all[0]));
    break;
  }
  return s;
}

}  // namespace

// Close to contact the nearest point itself is all cancellation, so the normals of the last
// simplex's triangles are tried as well; the best of them wins.
bool separating_direction(const std::vector<Vec>& a, const std::vector<Vec>& b, Vec* n,
                          double* separation) {
  *separation = -INFINITY;
  descend(a, b, [&](const Vec& d) {
    const double length = norm(d);
    if (!(length > 0)) return;
    for (const double sign : {1.0, -1.0}) {
      const Vec u = (sign / length) * d;
      const double s = dot(u, b[extreme(b, -1.0 * u)]) - dot(u, a[extreme(a, u)]);
      if (s > *separation) *separation = s, *n = u;
    }
  });
  return *separation > 0;
}

Vec middle_point(const std::vector<Vec>& a, const std::vector<Vec>& b) {
  const Nearest near = nearest(a, b);
  return 0.5 * (near.a + near.b);
}

Nearest nearest(const std::vector<Vec>& a, const std::vector<Vec>& b) {
  return descend(a, b, [](const Vec&) {}).of(a, b);
}

}  // namespace tauguard::rigid
