// The nearest points of two hulls of points, and the facet of the hull of their differences that is
// nearest to the origin, by signs of polynomials alone: with Dyadic every answer is right, with
// double it is a proposal that the caller certifies.
#pragma once

#include <array>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

template <class Number>
using Vector = std::array<Number, 3>;

template <class Number>
Vector<Number> minus(const Vector<Number>& x, const Vector<Number>& y) {
  return {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
}
template <class Number>
Number inner(const Vector<Number>& x, const Vector<Number>& y) {
  return x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
}
template <class Number>
Vector<Number> outer(const Vector<Number>& x, const Vector<Number>& y) {
  return {x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]};
}
template <class Number>
bool positive(const Number& x) {
  return Number() < x;
}
template <class Number>
bool is_zero(const Vector<Number>& x) {
  return x[0] == Number() && x[1] == Number() && x[2] == Number();
}

// Is x, the square of a volume, nothing but rounding beside `scale`?
inline bool negligible(double x, double scale) { return !(x > 1e-20 * scale); }
inline bool negligible(const Dyadic& x, const Dyadic&) { return x.is_zero(); }

// The points b_j - a_i.
template <class Number>
struct Differences {
  const Points<Number>&a, &b;
  using Pair = std::array<std::size_t, 2>;

  Vector<Number> at(const Pair& p) const { return minus(b[p[1]], a[p[0]]); }
  Pair farthest(const Vector<Number>& n) const {
    Pair best{0, 0};
    Number low = inner(n, a[0]), high = inner(n, b[0]);
    for (std::size_t i = 1; i < a.size(); ++i) {
      const Number x = inner(n, a[i]);
      if (x < low) low = x, best[0] = i;
    }
    for (std::size_t j = 1; j < b.size(); ++j) {
      const Number x = inner(n, b[j]);
      if (high < x) high = x, best[1] = j;
    }
    return best;
  }
};

// Nearest point of the hull of differences to the origin (Wolfe 1976; Gilbert, Johnson and Keerthi
// 1988): sum weight_k y_k / denominator, as numerator / denominator.
template <class Number>
class ExactNearest {
 public:
  using Pair = typename Differences<Number>::Pair;

  ExactNearest(const Points<Number>& a, const Points<Number>& b) : y_{a, b} {
    take({0, 0});
    keep();
    while (!is_zero(numerator)) {
      geometry::poll_interrupt();
      const Vector<Number> back = {-numerator[0], -numerator[1], -numerator[2]};
      const Pair next = y_.farthest(back);
      const Vector<Number> w = y_.at(next);
      // numerator . (w - numerator / denominator) >= 0: no difference is nearer.
      if (!(inner(numerator, w) * denominator < inner(numerator, numerator))) return;
      take(next);
      keep();
    }
  }

  std::vector<Pair> pairs;      // at most four
  std::vector<Number> weights;  // of `pairs`, over `denominator`
  Vector<Number> numerator;
  Number denominator;

 private:
  void take(const Pair& p) { pairs.push_back(p), points_.push_back(y_.at(p)); }

  // The face of the simplex that holds its point nearest to the origin: the one whose point has
  // weights above zero and no other corner before it.
  void keep() {
    const int m = static_cast<int>(points_.size());
    for (int mask = 1; mask < 1 << m; ++mask) {
      std::vector<int> face;
      for (int k = 0; k < m; ++k)
        if (mask >> k & 1) face.push_back(k);
      if (!weigh(face) || !is_nearest()) continue;
      std::vector<Pair> kept;
      std::vector<Vector<Number>> points;
      for (const int k : face) kept.push_back(pairs[k]), points.push_back(points_[k]);
      pairs = kept, points_ = points;
      return;
    }
  }

  bool is_nearest() const {
    const Number square = inner(numerator, numerator);
    for (const auto& p : points_)
      if (inner(numerator, p) * denominator < square) return false;
    return true;
  }

  // Weights of the point of the face's affine hull nearest to the origin, by Cramer's rule.
  bool weigh(const std::vector<int>& face) {
    const Vector<Number>& y0 = points_[face[0]];
    Vector<Number> e[3];
    for (std::size_t k = 1; k < face.size(); ++k) e[k - 1] = minus(points_[face[k]], y0);
    weights.assign(face.size(), Number());
    if (face.size() == 1) {
      denominator = Number(1.0);
    } else if (face.size() == 2) {
      denominator = inner(e[0], e[0]);
      weights[1] = -inner(e[0], y0);
    } else if (face.size() == 3) {
      const Number aa = inner(e[0], e[0]), ab = inner(e[0], e[1]), bb = inner(e[1], e[1]);
      const Number x = -inner(e[0], y0), y = -inner(e[1], y0);
      denominator = aa * bb - ab * ab;
      weights[1] = x * bb - y * ab, weights[2] = y * aa - x * ab;
    } else {
      denominator = inner(e[0], outer(e[1], e[2]));
      weights[1] = -inner(y0, outer(e[1], e[2]));
      weights[2] = -inner(y0, outer(e[2], e[0]));
      weights[3] = -inner(y0, outer(e[0], e[1]));
      if (!positive(denominator)) {
        denominator = -denominator;
        for (auto& w : weights) w = -w;
      }
    }
    if (!positive(denominator)) return false;
    weights[0] = denominator;
    for (std::size_t k = 1; k < face.size(); ++k) weights[0] = weights[0] - weights[k];
    for (const auto& w : weights)
      if (!positive(w)) return false;
    for (int c = 0; c < 3; ++c) {
      numerator[c] = denominator * y0[c];
      for (std::size_t k = 1; k < face.size(); ++k)
        numerator[c] = numerator[c] + weights[k] * e[k - 1][c];
    }
    if (face.size() == 4) numerator = {Number(), Number(), Number()};
    return true;
  }

  const Differences<Number> y_;
  std::vector<Vector<Number>> points_;
};

// Grows a polytope of differences at its face nearest to the origin until that face is one of the
// whole hull's (van den Bergen 2001, without a simplex that holds the origin to start from). Where
// the origin is inside, that is the least way in which the bodies come free.
template <class Number>
class NearestFacet {
 public:
  using Pair = typename Differences<Number>::Pair;
  enum class Answer { facet, flat, gave_up };

  NearestFacet(const Points<Number>& a, const Points<Number>& b) : y_{a, b} {}

  Answer solve(int most_faces) {
    if (!start()) return Answer::flat;
    while (static_cast<int>(faces_.size()) < most_faces) {
      geometry::poll_interrupt();
      if (broken_) return Answer::gave_up;
      std::size_t best = 0;
      for (std::size_t f = 1; f < faces_.size(); ++f)
        if (nearer(faces_[f], faces_[best])) best = f;
      normal = faces_[best].normal, offset = faces_[best].offset;
      const Pair next = y_.farthest(normal);
      const Vector<Number> w = y_.at(next);
      if (!positive(inner(normal, w) - offset)) return Answer::facet;
      // Rounding alone brings a point in twice, and there are fewer points than pairs.
      if (!taken_.insert(next).second) return Answer::facet;
      if (!grow(w, best)) return Answer::gave_up;
    }
    return Answer::gave_up;
  }

  Vector<Number> normal{};  // outward; where `flat` any normal of what they span, zero for a point
  Number offset{};          // normal . y <= offset for every difference

 private:
  struct Face {
    std::array<int, 3> corner;
    Vector<Number> normal;
    Number offset, square;
  };

  // Four differences that span space: the farthest from the first, from the line, from the plane.
  bool start() {
    const Vector<Number> y0 = y_.at({0, 0});
    std::vector<Vector<Number>> e;
    for (std::size_t i = 1; i < y_.a.size(); ++i) e.push_back(minus(y_.at({i, 0}), y0));
    for (std::size_t j = 1; j < y_.b.size(); ++j) e.push_back(minus(y_.at({0, j}), y0));
    Vector<Number> line{}, plane{}, out{};
    Number most{};
    const auto best = [&](auto measure, Vector<Number>& kept) {
      most = Number();
      for (const auto& x : e) {
        const Number m = measure(x);
        if (most < m) most = m, kept = x;
      }
      return positive(most);
    };
    if (!best([](const auto& x) { return inner(x, x); }, line)) return false;
    const auto area = [&](const auto& x) { return inner(outer(line, x), outer(line, x)); };
    normal = across(line);
    if (!best(area, plane)) return false;
    const Vector<Number> n = outer(line, plane);
    normal = n;
    const auto height = [&](const auto& x) { return inner(n, x) * inner(n, x); };
    if (!best(height, out)) return false;
    broken_ = negligible(most, inner(n, n) * inner(line, line));
    const auto plus = [&](const Vector<Number>& x) {
      return Vector<Number>{y0[0] + x[0], y0[1] + x[1], y0[2] + x[2]};
    };
    points_ = {y0, plus(line), plus(plane), plus(out)};
    for (int c = 0; c < 3; ++c)
      inside4_[c] = points_[0][c] + points_[1][c] + points_[2][c] + points_[3][c];
    add(0, 1, 2), add(0, 1, 3), add(0, 2, 3), add(1, 2, 3);
    return true;
  }

  static Vector<Number> across(const Vector<Number>& e) {
    if (e[0] == Number() && e[1] == Number()) return {Number(1.0), Number(), Number()};
    return {-e[1], e[0], Number()};
  }

  void add(int i, int j, int k) {
    Face f{{i, j, k},
           outer(minus(points_[j], points_[i]), minus(points_[k], points_[i])),
           Number(),
           Number()};
    f.offset = inner(f.normal, points_[i]);
    f.square = inner(f.normal, f.normal);
    if (!positive(f.square)) broken_ = true;
    const Number side = inner(f.normal, inside4_) - Number(4.0) * f.offset;
    if (negligible(side * side, f.square * inner(inside4_, inside4_))) broken_ = true;
    if (positive(side)) {
      for (int c = 0; c < 3; ++c) f.normal[c] = -f.normal[c];
      f.offset = -f.offset;
    }
    faces_.push_back(f);
  }

  // offset / |normal|, negative where the origin is outside.
  static bool nearer(const Face& f, const Face& g) {
    const bool f_out = f.offset < Number(), g_out = g.offset < Number();
    if (f_out != g_out) return f_out;
    const Number x = f.offset * f.offset * g.square, y = g.offset * g.offset * f.square;
    return f_out ? y < x : x < y;
  }

  // Replaces the faces that see w by the cone from w over their rim.
  bool grow(const Vector<Number>& w, std::size_t seen) {
    std::map<std::pair<int, int>, int> edges;
    std::vector<Face> rest;
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const Face& face = faces_[f];
      if (f != seen && !positive(inner(face.normal, w) - face.offset)) {
        rest.push_back(face);
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        const int i = face.corner[k], j = face.corner[(k + 1) % 3];
        ++edges[{std::min(i, j), std::max(i, j)}];
      }
    }
    const int apex = static_cast<int>(points_.size());
    points_.push_back(w);
    std::map<int, int> degree;
    faces_ = std::move(rest);
    int rim = 0;
    for (const auto& [edge, count] : edges) {
      if (count > 2) return false;
      if (count == 2) continue;
      ++rim, ++degree[edge.first], ++degree[edge.second];
      add(edge.first, edge.second, apex);
    }
    for (const auto& [corner, count] : degree)
      if (count != 2) return false;
    return rim >= 3;
  }

  const Differences<Number> y_;
  std::vector<Vector<Number>> points_;
  std::set<Pair> taken_;
  std::vector<Face> faces_;
  Vector<Number> inside4_{};
  bool broken_ = false;
};

}  // namespace tauguard::rigid
