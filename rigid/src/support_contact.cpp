// First contact of shapes given by support functions. Each step tries a separating plane that turns
// with the first body, one that turns with the second, and one that does not turn. The longest
// certified step is taken.
#include <algorithm>

#include "advancement.hpp"
#include "tauguard/rigid/first_contact.hpp"

namespace tauguard::rigid {
namespace {

// Limits the number of tiny steps for a pair at rest; at the limit the time is still never late.
constexpr int most_steps = 500;

double longest_step(const SupportShape& a, const SupportShape& b, const Distance& d, double offset,
                    double limit) {
  const Vec3 rates[3] = {cross(a.angular(), d.n), cross(b.angular(), d.n), Vec3{}};
  double best = 0;
  for (int i = 0; i < (a.half_space() ? 1 : 3); ++i) {
    const double turn = norm(rates[i]);
    if (i < 2 && !a.half_space() && turn == 0) continue;
    const double horizon = turn * limit > 1 ? 1 / turn : limit;
    const SeparationBound<SupportShape> g(a, b, {d.n, rates[i], turn}, horizon, offset,
                                          std::max(0.0, offset));
    best = std::max(best, safe_step(g, d.lower - offset, horizon, 0.05));
    if (best >= limit) break;
  }
  return best;
}

}  // namespace

Touch describe(const SupportShape& a, const SupportShape& b, const Distance& d, const Vec3& n,
               double t) {
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

Touch first_contact(SupportShape& a, SupportShape& b, double threshold, double start,
                    double touching) {
  const double radii = a.radius() + b.radius(), offset = radii + threshold;
  const double margin = 128 * unit_roundoff * (a.magnitude() + b.magnitude());
  const double close = offset + 2 * margin + touching * (a.reach() + b.reach() + radii);
  double t, seen = -1;  // `d` is the distance at time `seen`
  Vec3 n{};
  Distance d;
  // For curved cores the lower bound can be smaller than the true distance. A pair close to contact
  // then gets no certified step and is reported as a contact. This is too early by at most the
  // difference between bound and distance.
  const auto near = [&](double now) {
    seen = now;
    d = distance_of(a, b, n, close);
    return d.overlap || d.lower <= close;
  };
  const auto certified = [&](double left) {
    n = d.n;
    return longest_step(a, b, d, offset + margin, left);
  };
  if (!advance(a, b, start, 1, most_steps, near, certified, &t)) return {};
  if (seen != t) a.move_to(t), b.move_to(t), d = distance_of(a, b, n, close);
  return describe(a, b, d, n, t);
}

}  // namespace tauguard::rigid
