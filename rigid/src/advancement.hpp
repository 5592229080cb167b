// Conservative advancement (Mirtich 1996; Zhang, Lee and Kim 2006) along rotating directions.
//
// Let t be a time, n a unit vector and r any rate of change, and n(h) = n + h r the direction at
// time t + h. The separation of the bodies along n(h) is
//   s(h) = min_b n(h).x_b(t + h) - max_a n(h).x_a(t + h).
// The bodies are apart while s > 0, for any n and r. A computable lower bound G of s:
// 1. Let c be the centre of a. The projection n(h).(x - c) differs from its tangent at h = 0 by at
//    most K h^2 / 2, where K is a bound on its second derivative 2 r.(x - c)' + n(h).x''.
// 2. So s(h) >= G(h) = min_b (tangent) - max_a (tangent) - (Ka + Kb) h^2 / 2 - rounding.
// 3. G is concave. A step ends just before the root of G, so the bodies are apart during the step.
//
// Bodies grown by balls, whose radii have the sum R, are apart while s(h) > R |n(h)|. If r is
// perpendicular to n, |n(h)| <= 1 + (h |r|)^2 / 2. So G is reduced by R, and K is increased by R
// |r|^2.
#pragma once

#include <algorithm>
#include <utility>

#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::rigid {

struct Turning {
  Vec3 n, rate;  // direction and its rate of change
  double turn;   // bound on |rate|
};

// The largest tangent over the vertices of a body as a function of h, and its slope.
class VertexTangents {
 public:
  VertexTangents(const MovingBody& body, const Vec3& n, const Vec3& rate, const Vec3& centre,
                 const Vec3& drift)
      : lines_(body.now.size()) {
    for (std::size_t i = 0; i < lines_.size(); ++i) {
      const Vec3 x = body.now[i] - centre;
      lines_[i] = {dot(n, x), dot(rate, x) + dot(n, body.velocity[i] - drift)};
    }
  }
  double operator()(double h, double* slope) const {
    double top = -INFINITY;
    for (const auto& [p, v] : lines_)
      if (p + h * v > top) top = p + h * v, *slope = v;
    return top;
  }

 private:
  std::vector<std::array<double, 2>> lines_;
};

// As VertexTangents, for a shape: one call of its support function.
class SupportTangent {
 public:
  SupportTangent(const SupportShape& shape, const Vec3& n, const Vec3& rate, const Vec3& centre,
                 const Vec3& drift)
      : shape_(shape), n_(n), rate_(rate), centre_(centre), drift_(drift) {}
  double operator()(double h, double* slope) const {
    return shape_.tangent(n_, rate_, h, centre_, drift_, slope);
  }

 private:
  const SupportShape& shape_;
  const Vec3 n_, rate_, centre_, drift_;
};

inline VertexTangents tangents(const MovingBody& body, const Vec3& n, const Vec3& rate,
                               const Vec3& centre, const Vec3& drift) {
  return VertexTangents(body, n, rate, centre, drift);
}
inline SupportTangent tangents(const SupportShape& shape, const Vec3& n, const Vec3& rate,
                               const Vec3& centre, const Vec3& drift) {
  return SupportTangent(shape, n, rate, centre, drift);
}

// G and its slope at h. `offset` is what G subtracts from the separation: the radii R, the rounding
// bound, and for shapes the required distance. `radius` is R, which also increases K.
template <class Body>
class SeparationBound {
 public:
  SeparationBound(const Body& a, const Body& b, const Turning& d, double horizon, double offset,
                  double radius)
      : a_(tangents(a, d.n, d.rate, a.centre(), a.linear())),
        b_(tangents(b, -1.0 * d.n, -1.0 * d.rate, a.centre(), a.linear())),
        offset_(offset) {
    const double drift = d.turn * horizon;
    half_k_ = d.turn * (a.speed_about(a.linear()) + b.speed_about(a.linear())) +
              0.5 * (a.acceleration(d.n, drift) + b.acceleration(d.n, drift)) +
              0.5 * radius * d.turn * d.turn;
  }

  double operator()(double h, double* slope) const {
    double up, down;
    const double top = a_(h, &up), bottom = b_(h, &down);
    *slope = -down - up - 2 * half_k_ * h;
    return -bottom - top - half_k_ * h * h - offset_;
  }

 private:
  decltype(tangents(std::declval<Body>(), {}, {}, {}, {})) a_, b_;
  double offset_, half_k_;
};

// A step, at most `limit`, with G >= 0 on [0, step]; at_zero = G(0) > 0. G is concave, so Newton's
// method from `limit` stays to the right of the root. It ends at a point where G > -accuracy G(0).
// The chord from (0, G(0)) to this point crosses zero to the left of the root; there the step ends.
template <class Bound>
double safe_step(const Bound& g, double at_zero, double limit, double accuracy) {
  double slope, h = limit, value = g(h, &slope);
  if (value >= 0) return limit;
  for (int i = 0; i < 60 && value < -accuracy * at_zero; ++i) {
    const double next = h - value / slope;
    if (!(next < h) || !(next > 0)) break;
    h = next;
    value = g(h, &slope);
  }
  return value >= 0 ? h : h * (at_zero / (at_zero - value)) * (1 - 4 * unit_roundoff);
}

// Advances both bodies from `start` until close(t) is true. certified(left) returns a step during
// which the bodies stay apart; `left` is the remaining time. The result is true if they come close,
// at a time *t that is never late, else false.
template <class Body, class Close, class Certified>
bool advance(Body& a, Body& b, double start, double end, double most_steps, const Close& close,
             const Certified& certified, double* t) {
  *t = start;
  for (int step = 0; step < most_steps; ++step) {
    a.move_to(*t), b.move_to(*t);
    if (close(*t)) return true;
    const double left = end - *t, h = certified(left);
    if (h >= left) return *t = end, false;
    if (*t + h <= *t) return true;
    *t += h;
  }
  return true;
}

}  // namespace tauguard::rigid
