// The nearest points of two hulls of points. Every decision is the sign of a polynomial, so the
// result is exact with Dyadic.
#pragma once

#include "expanding_polytope.hpp"

namespace tauguard::rigid {

// The point of the hull of differences nearest to the origin (Wolfe 1976; Gilbert, Johnson and
// Keerthi 1988). It is numerator / denominator, with numerator = sum of weights_k y_k, y_k the
// differences of `pairs`.
template <class Number>
class ExactNearest {
 public:
  using Pair = typename PointDifferences<Number>::Source;

  // `start`: the corners from which the search starts.
  ExactNearest(const Points<Number>& a, const Points<Number>& b, const std::vector<Pair>& start)
      : y_(a, b) {
    for (const Pair& pair : start) take(pair);
    keep(0);
    while (!is_zero(numerator)) {
      geometry::poll_interrupt();
      const Pair next = y_.farthest(-numerator);
      const Vector3<Number> w = y_.at(next);
      // If numerator . (w - numerator / denominator) >= 0, no difference is nearer.
      if (!(dot(numerator, w) * denominator < dot(numerator, numerator))) return;
      take(next);
      keep(1u << (pairs.size() - 1));
    }
  }

  std::vector<Pair> pairs;      // at most four
  std::vector<Number> weights;  // of `pairs`, over `denominator`
  Vector3<Number> numerator;
  Number denominator;

 private:
  void take(const Pair& p) { pairs.push_back(p), points_.push_back(y_.at(p)); }

  // Reduces the simplex to the face that contains its point nearest to the origin: all weights are
  // positive, and no other corner is nearer along the direction to this point. The bits of `with`
  // are corners that the face must have.
  void keep(unsigned with) {
    const int m = static_cast<int>(points_.size());
    for (unsigned mask = (1u << m) - 1; mask > 0; --mask) {
      if ((mask & with) != with) continue;
      std::vector<int> face;
      for (int k = 0; k < m; ++k)
        if (mask >> k & 1) face.push_back(k);
      if (!weigh(face) || !is_nearest()) continue;
      std::vector<Pair> kept;
      std::vector<Vector3<Number>> points;
      for (const int k : face) kept.push_back(pairs[k]), points.push_back(points_[k]);
      pairs = kept, points_ = points;
      return;
    }
  }

  bool is_nearest() const {
    const Number square = dot(numerator, numerator);
    for (const auto& p : points_)
      if (dot(numerator, p) * denominator < square) return false;
    return true;
  }

  // The weights of the point nearest to the origin in the affine hull of a face, by Cramer's rule.
  bool weigh(const std::vector<int>& face) {
    const Vector3<Number>& y0 = points_[face[0]];
    Vector3<Number> e[3];
    for (std::size_t k = 1; k < face.size(); ++k) e[k - 1] = points_[face[k]] - y0;
    weights.assign(face.size(), Number());
    if (face.size() == 1) {
      denominator = Number(1.0);
    } else if (face.size() == 2) {
      denominator = dot(e[0], e[0]);
      weights[1] = -dot(e[0], y0);
    } else if (face.size() == 3) {
      const Number aa = dot(e[0], e[0]), ab = dot(e[0], e[1]), bb = dot(e[1], e[1]);
      const Number x = -dot(e[0], y0), y = -dot(e[1], y0);
      denominator = aa * bb - ab * ab;
      weights[1] = x * bb - y * ab, weights[2] = y * aa - x * ab;
    } else {
      denominator = dot(e[0], cross(e[1], e[2]));
      weights[1] = -dot(y0, cross(e[1], e[2]));
      weights[2] = -dot(y0, cross(e[2], e[0]));
      weights[3] = -dot(y0, cross(e[0], e[1]));
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
    numerator = denominator * y0;
    for (std::size_t k = 1; k < face.size(); ++k) numerator += weights[k] * e[k - 1];
    if (face.size() == 4) numerator = {};
    return true;
  }

  const PointDifferences<Number> y_;
  std::vector<Vector3<Number>> points_;
};

}  // namespace tauguard::rigid
