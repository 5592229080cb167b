// Conservative advancement (Mirtich 1996; Zhang, Lee and Kim 2006) on support functions, with
// directions that turn, as rigid/src/first_contact.cpp has it for vertices. For any unit n, any
// rate r and n(h) = n + h r, the separation of the cores along n(h) at time t + h is at least
//   G(h) = -(tangent of b along -n(h)) - (tangent of a along n(h)) - K h^2 / 2,
// where a tangent is the largest of the vertices' own tangents (one support call) and K bounds
// their second derivatives. The surfaces are apart by more than the threshold while G(h) exceeds
// (radii + threshold) |n(h)|. Three rates are tried, standing still and turning with either
// partner; the longest certified step is taken.
#include "advance.hpp"

#include <algorithm>

#include "penetration.hpp"

namespace tauguard::contacts {
namespace {

// A guard against creeping along a resting gap: the time reached is still never late.
constexpr int most_steps = 500;

class Lower {
 public:
  Lower(const Mover& a, const Mover& b, const Vec& n, const Vec& r, double offset, double horizon)
      : a_(a), b_(b), n_(n), r_(r), c_(a.centre()), drift_(a.linear()), offset_(offset) {
    const double turn = norm(r);
    half_k_ = turn * (a.speed_about(drift_) + b.speed_about(drift_)) +
              0.5 * (a.acceleration(n, turn * horizon) + b.acceleration(n, turn * horizon)) +
              0.5 * std::max(0.0, offset) * turn * turn;
  }
  double operator()(double h) const {
    const Vec minus_n = -1.0 * n_, minus_r = -1.0 * r_;
    return -b_.tangent(minus_n, minus_r, h, c_, drift_) - a_.tangent(n_, r_, h, c_, drift_) -
           half_k_ * h * h - offset_;
  }

 private:
  const Mover& a_;
  const Mover& b_;
  Vec n_, r_, c_, drift_;
  double offset_, half_k_;
};

// A step on which G >= 0, G being concave with G(0) > 0: secants through (0, G(0)) end left of the
// root.
double safe_step(const Lower& g, double at_zero, double limit) {
  double right = limit, value = g(limit);
  if (value >= 0) return limit;
  double left = 0, left_value = at_zero, short_of = 8 * unit_roundoff;
  for (int i = 0; i < 8; ++i) {
    // The chord of a concave function lies below it: its root is certified. Where G is all but a
    // line, rounding hides the sign at the root: ever more is left out, or no step would remain.
    const double h = left + (right - left) * (left_value / (left_value - value)) * (1 - short_of);
    short_of *= 16;
    if (!(h > left) || !(h < right)) break;
    const double here = g(h);
    if (here < 0) {
      right = h, value = here;
      continue;
    }
    const bool done = here <= 0.05 * left_value || h - left < 0.05 * h;
    left = h, left_value = here;
    if (done) break;
  }
  return left;
}

double longest_step(const Mover& a, const Mover& b, const Distance& d, double offset,
                    double limit) {
  const Vec rates[3] = {cross(a.angular(), d.n), cross(b.angular(), d.n), Vec{}};
  double best = 0;
  for (int i = 0; i < (a.half_space() ? 1 : 3); ++i) {
    const double turn = norm(rates[i]);
    if (i < 2 && !a.half_space() && turn == 0) continue;
    const double horizon = turn * limit > 1 ? 1 / turn : limit;
    const Lower g(a, b, d.n, rates[i], offset, horizon);
    best = std::max(best, safe_step(g, d.lower - offset, horizon));
    if (best >= limit) break;
  }
  return best;
}

}  // namespace

Touch describe(const Mover& a, const Mover& b, const Distance& d, const Vec& n, double t) {
  const double radii = a.radius() + b.radius();
  const double size = a.reach() + b.reach() + radii;
  Touch touch;
  touch.hit = true, touch.t = t;
  Distance at = d;
  if (d.overlap && dot(n, n) > 0 && t > 0)
    at.n = n, at.lower = std::min(0.0, d.lower);
  else if (d.overlap && !a.half_space())
    penetration(a, b, &at);
  else if (!a.half_space() && d.upper > 1e-7 * size)
    at.n = (1 / d.upper) * (d.on_b - d.on_a), at.lower = d.upper;
  else if (dot(n, n) > 0 && !a.half_space())
    at.n = n;
  touch.normal = at.n;
  touch.distance = at.lower - radii;
  touch.point = 0.5 * (at.on_a + a.radius() * at.n + at.on_b - b.radius() * at.n);
  return touch;
}

Touch first_touch(Mover& a, Mover& b, double threshold, double start, double touching) {
  const double radii = a.radius() + b.radius(), offset = radii + threshold;
  const double margin = 128 * unit_roundoff * (a.magnitude() + b.magnitude());
  const double close = offset + 2 * margin + touching * (a.reach() + b.reach() + radii);
  double t = start;
  Vec n{};
  for (int step = 0; step < most_steps; ++step) {
    a.move_to(t), b.move_to(t);
    const Distance d = distance_of(a, b, n, close);
    if (d.overlap || d.lower <= close) {
      // With curved cores the bound may lag behind the distance: what the segment says is then not
      // a contact yet, but no step is certified either. It is reported, early by at most what the
      // bound lags.
      return describe(a, b, d, n, t);
    }
    n = d.n;
    const double left = 1 - t, h = longest_step(a, b, d, offset + margin, left);
    if (h >= left) return {};
    if (t + h <= t) return describe(a, b, d, n, t);
    t += h;
  }
  a.move_to(t), b.move_to(t);
  return describe(a, b, distance_of(a, b, n, close), n, t);
}

}  // namespace tauguard::contacts
