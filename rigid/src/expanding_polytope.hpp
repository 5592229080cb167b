// The facet of a convex set of differences b - a that is nearest to the origin, by the expanding
// polytope of van den Bergen (2001). The first simplex need not contain the origin. If the origin
// is inside the set, the facet gives the shortest translation that separates the bodies. Every
// decision is the sign of a polynomial, so the result is exact with Dyadic. With double,
// depth_bound.hpp certifies the result for vertex lists, not for support shapes.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <type_traits>
#include <utility>
#include <vector>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

template <class Number>
bool positive(const Number& x) {
  return Number() < x;
}
template <class Number>
bool is_zero(const Vector3<Number>& x) {
  return x == Vector3<Number>();
}

// Whether x, the square of a volume, is only a rounding error compared with `scale`.
inline bool negligible(double x, double scale) { return !(x > 1e-20 * scale); }
inline bool negligible(const Dyadic& x, const Dyadic&) { return x.is_zero(); }

// Whether the sign of `side`, of a face with corners y, may be wrong because of rounding (step 1 of
// depth_bound.hpp). Also true if a square is too small or too large for a double.
inline bool side_is_rounding(double side, const Vec3& normal, const std::array<const Vec3*, 3>& y,
                             double square, double size) {
  // The largest difference of the corners along the normal.
  const double x = dot(normal, *y[0]), spread = std::max(std::fabs(dot(normal, *y[1]) - x),
                                                         std::fabs(dot(normal, *y[2]) - x));
  const double scale = square * (size * size), clear = std::fabs(side) - 4 * spread;
  return !(scale > 1e-290 && clear > 0 && clear * clear > 0x1p-88 * scale);
}

// Finds four differences that span space, as PointDifferences::span, from support points. `small`:
// a length that counts as zero.
template <class Set>
bool span_by_supports(const Set& set, double small, std::array<Vec3, 4>* y,
                      std::array<typename Set::Source, 4>* from, Vec3* normal) {
  const auto take = [&](int k, const Vec3& d) {
    (*y)[k] = set.at((*from)[k] = set.farthest(-1.0 * d));
  };
  const auto edge = [&](int k) { return (*y)[k] - (*y)[0]; };
  for (int axis = 0; axis < 3 && (axis == 0 || !(norm(edge(1)) > small)); ++axis) {
    Vec3 d{};
    d[axis] = 1;
    take(0, d), take(1, -1.0 * d);
  }
  const auto add_off = [&](int k, const Vec3& d, const auto& off) {
    for (const double sign : {1.0, -1.0}) {
      take(k, sign * d);
      if (off(edge(k))) return true;
    }
    return false;
  };
  const Vec3 e = edge(1);
  Vec3 side{};
  side[geometry::smallest_axis(e)] = 1;
  const Vec3 u = cross(e, side), w = cross(e, u);
  *normal = u;
  const auto off_line = [&](const Vec3& x) { return norm(cross(e, x)) > small * norm(e); };
  if (!add_off(2, u, off_line) && !add_off(2, w, off_line)) return false;
  const Vec3 n = cross(e, edge(2));
  *normal = n;
  return add_off(3, n, [&](const Vec3& x) { return std::fabs(dot(n, x)) > small * norm(n); });
}

// The differences b_j - a_i of two lists of points.
template <class Number>
class PointDifferences {
 public:
  using Source = std::array<std::size_t, 2>;  // rows of a and of b

  // `size`: the largest coordinate, to which rounding errors of doubles are relative.
  PointDifferences(const Points<Number>& a, const Points<Number>& b, double size = 0)
      : a_(a), b_(b), size_(size) {}

  Vector3<Number> at(const Source& p) const { return b_[p[1]] - a_[p[0]]; }
  Source farthest(const Vector3<Number>& n) const {
    Source best{0, 0};
    Number low = dot(n, a_[0]), high = dot(n, b_[0]);
    for (std::size_t i = 1; i < a_.size(); ++i) {
      const Number x = dot(n, a_[i]);
      if (x < low) low = x, best[0] = i;
    }
    for (std::size_t j = 1; j < b_.size(); ++j) {
      const Number x = dot(n, b_[j]);
      if (high < x) high = x, best[1] = j;
    }
    return best;
  }

  // Finds four differences that span space: a first one, the farthest from it, the farthest from
  // the line through both, and the farthest from the plane through the three. False if the set is
  // flat; `normal` is then a normal of the set (zero for a point). `thin`: whether the tetrahedron
  // is flat up to rounding.
  bool span(std::array<Vector3<Number>, 4>* y, std::array<Source, 4>* from, Vector3<Number>* normal,
            bool* thin) const {
    const Vector3<Number> y0 = at({0, 0});
    std::vector<Vector3<Number>> e;
    std::vector<Source> sources;
    for (std::size_t i = 1; i < a_.size(); ++i) sources.push_back({i, 0});
    for (std::size_t j = 1; j < b_.size(); ++j) sources.push_back({0, j});
    for (const Source& s : sources) e.push_back(at(s) - y0);
    Number most{};
    const auto best = [&](const auto& measure, int corner) {
      most = Number();
      std::size_t kept = 0;
      for (std::size_t i = 0; i < e.size(); ++i) {
        const Number m = measure(e[i]);
        if (most < m) most = m, kept = i;
      }
      if (!positive(most)) return false;
      (*from)[corner] = sources[kept];
      (*y)[corner] = y0 + e[kept];
      return true;
    };
    const auto edge = [&](int corner) { return at((*from)[corner]); };
    (*y)[0] = y0, (*from)[0] = {0, 0};
    if (!best([](const auto& x) { return dot(x, x); }, 1)) return false;
    const Vector3<Number> line = edge(1) - y0;
    *normal = across(line);
    const auto area = [&](const auto& x) { return dot(cross(line, x), cross(line, x)); };
    if (!best(area, 2)) return false;
    const Vector3<Number> n = cross(line, edge(2) - y0);
    *normal = n;
    if (!best([&](const auto& x) { return dot(n, x) * dot(n, x); }, 3)) return false;
    *thin = negligible(most, dot(n, n) * dot(line, line));
    return true;
  }

  // Whether a facet of the polytope is also a facet of the set. `excess` tells how far the set's
  // farthest point is beyond the facet. If it was added before, the excess is rounding.
  bool is_final(const Number& excess, const Number&, const Source& farthest) {
    return !positive(excess) || !taken_.insert(farthest).second;
  }
  bool sees(const Number& excess, const Number&) const { return positive(excess); }
  // Whether the sign of `side`, four times a height above a triangle, may be wrong.
  bool unsure(const Number& side, const Vector3<Number>& normal, const Number& square,
              const std::array<const Vector3<Number>*, 3>& y) const {
    if constexpr (std::is_same_v<Number, double>)
      return side_is_rounding(side, normal, y, square, size_);
    return false;
  }

 private:
  static Vector3<Number> across(const Vector3<Number>& e) {
    if (e[0] == Number() && e[1] == Number()) return {Number(1.0), Number(), Number()};
    return {-e[1], e[0], Number()};
  }

  const Points<Number>&a_, &b_;
  const double size_;
  std::set<Source> taken_;
};

// Expands a polytope of differences at its face nearest to the origin until that face is final.
template <class Number, class Differences>
class ExpandingPolytope {
 public:
  using Source = typename Differences::Source;
  enum class Answer { facet, flat, gave_up };
  struct Face {
    std::array<int, 3> corner;
    Vector3<Number> normal;  // outward; if `flat`, a normal of the set (zero for a point)
    Number offset;           // normal . y for the corners y
    Number square;           // normal . normal
  };

  explicit ExpandingPolytope(Differences differences) : differences_(std::move(differences)) {}

  Answer solve(int most_faces) {
    std::array<Vector3<Number>, 4> y;
    std::array<Source, 4> from;
    if (!differences_.span(&y, &from, &nearest.normal, &broken_)) return Answer::flat;
    points_.assign(y.begin(), y.end()), sources_.assign(from.begin(), from.end());
    inside4_ = y[0] + y[1] + y[2] + y[3];
    add(0, 1, 2), add(0, 1, 3), add(0, 2, 3), add(1, 2, 3);
    while (static_cast<int>(faces_.size()) < most_faces) {
      geometry::poll_interrupt();
      if (broken_) return Answer::gave_up;
      std::size_t best = 0;
      for (std::size_t f = 1; f < faces_.size(); ++f)
        if (nearer(faces_[f], faces_[best])) best = f;
      nearest = faces_[best];
      const Source next = differences_.farthest(nearest.normal);
      const Vector3<Number> w = differences_.at(next);
      if (differences_.is_final(dot(nearest.normal, w) - nearest.offset, nearest.square, next))
        return Answer::facet;
      sources_.push_back(next);
      if (!grow(w, best)) return Answer::gave_up;
    }
    return Answer::gave_up;
  }

  Face nearest{};  // the face nearest to the origin so far
  const std::vector<Face>& faces() const { return faces_; }
  const Vector3<Number>& point(int corner) const { return points_[corner]; }
  const Source& source(int corner) const { return sources_[corner]; }

 private:
  void add(int i, int j, int k) {
    Face f{{i, j, k}, cross(points_[j] - points_[i], points_[k] - points_[i]), Number(), Number()};
    f.offset = dot(f.normal, points_[i]);
    f.square = dot(f.normal, f.normal);
    if (!positive(f.square)) broken_ = true;
    const Number side = dot(f.normal, inside4_) - Number(4.0) * f.offset;
    if (negligible(side * side, f.square * dot(inside4_, inside4_))) broken_ = true;
    if (differences_.unsure(side, f.normal, f.square, {&points_[i], &points_[j], &points_[k]}))
      broken_ = true;
    if (positive(side)) {
      f.normal = -f.normal;
      f.offset = -f.offset;
    }
    faces_.push_back(f);
  }

  // Whether offset / |normal| is smaller for f than for g. It is negative if the origin is outside.
  static bool nearer(const Face& f, const Face& g) {
    const bool f_out = f.offset < Number(), g_out = g.offset < Number();
    if (f_out != g_out) return f_out;
    const Number x = f.offset * f.offset * g.square, y = g.offset * g.offset * f.square;
    return f_out ? y < x : x < y;
  }

  // Replaces the faces that are visible from w by the cone from w over their rim. False if rounding
  // makes the rim something else than one or more closed curves.
  bool grow(const Vector3<Number>& w, std::size_t seen) {
    auto& edges = edges_;
    auto& degree = degree_;
    edges.clear();
    std::size_t rest = 0;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const Face& face = faces_[f];
      if (f != seen && !differences_.sees(dot(face.normal, w) - face.offset, face.square)) {
        if (rest != f) faces_[rest] = face;
        ++rest;
        continue;
      }
      for (int k = 0; k < 3; ++k)
        edges.push_back(std::minmax<int>({face.corner[k], face.corner[(k + 1) % 3]}));
    }
    const int apex = static_cast<int>(points_.size());
    points_.push_back(w);
    faces_.resize(rest);
    std::sort(edges.begin(), edges.end());
    degree.assign(points_.size(), 0);
    int rim = 0;
    for (std::size_t i = 0, count; i < edges.size(); i += count) {
      for (count = 1; i + count < edges.size() && edges[i + count] == edges[i];) ++count;
      if (count > 2) return false;
      if (count == 2) continue;
      ++rim, ++degree[edges[i].first], ++degree[edges[i].second];
      add(edges[i].first, edges[i].second, apex);
    }
    for (const int count : degree)
      if (count != 0 && count != 2) return false;
    return rim >= 3;
  }

  Differences differences_;
  std::vector<Vector3<Number>> points_;
  std::vector<Source> sources_;
  std::vector<Face> faces_;
  std::vector<std::pair<int, int>> edges_;
  std::vector<int> degree_;
  Vector3<Number> inside4_{};
  bool broken_ = false;
};

}  // namespace tauguard::rigid
