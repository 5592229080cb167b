// First contact of bodies given by vertices, by conservative advancement (advancement.hpp). The
// direction n is the best separating axis at time t, and r is the rate at which it turns with the
// bodies. Then all vertices of the touching features have the same tangent, and the steps converge
// quadratically from below. (With r = 0 a turning face tilts away from n, and convergence is
// linear.) For bodies grown by balls, n points along the segment between the nearest points of the
// hulls, and r is the rate at which this segment turns with the features of its ends.
#include "tauguard/rigid/first_contact.hpp"

#include <algorithm>

#include "advancement.hpp"
#include "convex_lanes.hpp"
#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {
namespace {

// The number of steps is limited to `most_steps`, plus `steps_a_radian` per radian of both
// rotations. A small constant gap can need `most_steps`. Bodies that pass close to each other need
// a few steps per radian. At the limit the time is still never late.
constexpr int most_steps = 20000, steps_a_radian = 64;
// spun_step is tried if the bodies rotate by more than this angle [rad] in all.
constexpr double little_turn = 4;

struct Axis {
  Vec3 n{}, rate{};
  double separation = -INFINITY;
};

double least(const std::vector<Vec3>& points, const Vec3& n) {
  double m = INFINITY;
  for (const Vec3& p : points) m = std::min(m, dot(n, p));
  return m;
}

double most(const std::vector<Vec3>& points, const Vec3& n) {
  double m = -INFINITY;
  for (const Vec3& p : points) m = std::max(m, dot(n, p));
  return m;
}

double rounding(const MovingBody& a, const MovingBody& b) { return a.rounding + b.rounding; }

// The separation of the surfaces along n, from a to b.
double separation_along(const MovingBody& a, const MovingBody& b, const Vec3& n) {
  return least(b.now, n) - most(a.now, n) - rounding(a, b);
}

// Tries those of four unit vectors that are `regular`, and their opposites. The first one that
// separates the bodies most, and more than `best`, replaces `best`. Returns the lane, or -1.
TAUGUARD_INLINE int consider(const MovingBody& a, const MovingBody& b, const Vec3x4& n,
                             Mask4 regular, Axis* best) {
  const Range4 ra = range(a.now, n), rb = range(b.now, n);
  const Double4 forward = rb.low - ra.high - rounding(a, b),
                backward = ra.low - rb.high - rounding(a, b), both = max(forward, backward);
  int chosen = -1;
  if (!any(regular & (both > best->separation))) return chosen;
  for (int lane = 0; lane < 4; ++lane) {
    if (!regular[lane] || !(both[lane] > best->separation)) continue;
    chosen = lane;
    const bool ahead = forward[lane] >= backward[lane];
    *best = {(ahead ? 1.0 : -1.0) * lane_of(n, lane), {}, both[lane]};
  }
  return chosen;
}

// The rate of change of v / |v|, where v is the vector between the nearest points of the hulls and
// moves with the features that these points are on.
Vec3 feature_rate(const MovingBody& a, const MovingBody& b, const Nearest& near, const Vec3& v) {
  Vec3 w[3], u[3];
  for (int i = 0; i < near.size; ++i) {
    const auto [p, q] = near.corner[i];
    w[i] = b.now[q] - a.now[p], u[i] = b.velocity[q] - a.velocity[p];
  }
  const double square = dot(v, v);
  const auto across = [&](const Vec3& x) { return x - (dot(x, v) / square) * v; };
  const double length = std::sqrt(square);
  if (near.size == 1) return (1 / length) * across(u[0]);
  const Vec3 e = w[1] - w[0], f = u[1] - u[0];
  if (near.size == 2) {  // v stays perpendicular to the edge e
    const double ee = dot(e, e), fraction = -dot(w[0], e) / ee;
    const Vec3 moved = u[0] + fraction * f;
    return (1 / length) * across(moved - ((dot(moved, e) + dot(v, f)) / ee) * e);
  }
  const Vec3 g = w[2] - w[0], h = u[2] - u[0], c = cross(e, g);
  const Vec3 turned = across(cross(f, g) + cross(e, h));
  return (dot(c, v) < 0 ? -1 : 1) / norm(c) * turned;
}

Axis nearest_axis(const MovingBody& a, const MovingBody& b) {
  const Nearest near = nearest(a.now, b.now);
  const Vec3 v = near.b - near.a;
  const double length = norm(v);
  if (near.size == 4 || !(length > 0)) return {};
  const Vec3 n = (1 / length) * v;
  const Vec3 rate = feature_rate(a, b, near, v);
  return {n, norm(rate) < HUGE_VAL ? rate : Vec3{}, separation_along(a, b, n)};
}

TAUGUARD_CLONES Axis best_axis(const MovingBody& a, const MovingBody& b, double enough) {
  Axis best;
  if (rounding(a, b) > 0) {
    best = nearest_axis(a, b);
    if (best.separation > enough) return best;
  }
  int chosen = -1;  // 0: turns with a, 1: with b, 2: crossed edges x, y
  Vec3 x{}, y{};
  for (const MovingBody* body : {&a, &b})
    for (std::size_t i = 0; i < body->normal.size(); i += 4)
      if (consider(a, b, lanes_of(body->normal.data(), body->normal.size(), i), ~Mask4{}, &best) >=
          0)
        chosen = body == &b;
  for (const Vec3& ea : a.edge)
    for (std::size_t j = 0; j < b.edge.size(); j += 4) {
      const Vec3x4 n = cross(lanes_of(&ea, 1, 0), lanes_of(b.edge.data(), b.edge.size(), j));
      const Double4 square = dot(n, n);
      const int lane = consider(a, b, (1 / sqrt(square)) * n, square > 1e-24, &best);
      if (lane >= 0) chosen = 2, x = ea, y = b.edge[std::min(j + lane, b.edge.size() - 1)];
    }
  if (best.separation <= enough && !(a.complete && b.complete)) {
    Axis other;
    separating_direction(a.now, b.now, &other.n, &other.separation);
    other.separation -= rounding(a, b);
    if (other.separation > best.separation) {
      other.rate = cross(a.angular(), other.n);
      return other;
    }
  }
  if (chosen == 0) best.rate = cross(a.angular(), best.n);
  if (chosen == 1) best.rate = cross(b.angular(), best.n);
  if (chosen == 2) {
    const Vec3 c = cross(x, y),
               turned = cross(cross(a.angular(), x), y) + cross(x, cross(b.angular(), y));
    best.rate = (dot(c, best.n) < 0 ? -1 : 1) / norm(c) * (turned - dot(turned, best.n) * best.n);
  }
  return best;
}

double certified_step(const MovingBody& a, const MovingBody& b, const Axis& axis, double margin,
                      double left) {
  // n + h r is a useful direction only up to a rotation of about a radian.
  const double rate = norm(axis.rate), horizon = rate * left > 1 ? 1 / rate : left;
  const Turning direction{axis.n, axis.rate, rate * (1 + 0x1p-40)};
  const SeparationBound<MovingBody> g(a, b, direction, horizon, margin + rounding(a, b),
                                      rounding(a, b));
  return safe_step(g, axis.separation - margin, horizon, 1e-6);
}

// The longest step during which one fixed direction separates the bodies, whatever their rotation;
// `axis` becomes this direction. Bodies that rotate fast and pass each other need only a few such
// steps, while certified_step needs at least one per radian.
double spun_step(const MovingBody& a, const MovingBody& b, double margin, Axis* axis) {
  const Vec3 between = b.centre() - a.centre(), drift = b.linear() - a.linear();
  const auto across = [](const Vec3& v, const Vec3& n) { return v - dot(v, n) * n; };
  const Vec3 tried[] = {axis->n,
                        between,
                        a.axis(),
                        b.axis(),
                        across(between, a.axis()),
                        across(between, b.axis()),
                        across(axis->n, a.axis()),
                        across(axis->n, b.axis())};
  double longest = 0;
  for (const Vec3& v : tried) {
    const double length = norm(v);
    if (!(length > 0)) continue;
    for (const double sign : {1.0, -1.0}) {
      const Vec3 n = (sign / length) * v;
      const double gap =
          dot(n, between) + b.spun(n)[0] - a.spun(n)[1] - rounding(a, b) - 2 * margin;
      if (!(gap > 0)) continue;
      const double closing = -dot(n, drift) + 4 * unit_roundoff * norm(drift);
      const double h = closing > 0 ? gap / closing * (1 - 4 * unit_roundoff) : INFINITY;
      if (h > longest) longest = h, *axis = {n, {}, gap};
    }
  }
  return longest;
}

// The direction of contact. It is the last certain axis, turned for the time h, if this axis
// separates the bodies as well as the present best axis; otherwise it is the best axis. The error
// of the turned axis is of second order in h. It is needed for flat bodies in a common plane: the
// normal of this plane separates them by zero, as their contact normal does.
Vec3 contact_normal(const MovingBody& a, const MovingBody& b, const Axis& last, double h,
                    const Axis& now) {
  if (last.separation > -INFINITY) {
    const Vec3 turned = last.n + h * last.rate, n = (1 / norm(turned)) * turned;
    const double slack = contact_tolerance(a, b), separation = separation_along(a, b, n);
    if (separation >= -slack && separation >= now.separation - slack) return n;
  }
  return now.separation > -INFINITY ? now.n : Vec3{};
}

}  // namespace

Impact first_contact(MovingBody& a, MovingBody& b, double start, double end) {
  // Rounding: a projection takes fewer than 40 operations on values up to `magnitude`. Separations
  // and tangents both contain projections of both bodies; 128 covers them.
  const double margin = 128 * unit_roundoff * (a.magnitude() + b.magnitude());
  double t, before = start;
  Axis axis;  // at time t
  Axis last;  // at time `before`, where it certainly separates; at contact this is not certain
  const double turning = (a.angular_speed() + b.angular_speed()) * (end - start);
  const double limit = most_steps + steps_a_radian * std::min(turning, 1e6);
  const auto close = [&](double) {
    geometry::poll_interrupt();
    axis = best_axis(a, b, 2 * margin);
    return axis.separation <= 2 * margin;
  };
  const auto certified = [&](double left) {
    double h = certified_step(a, b, axis, margin, left);
    if (h < left && rounding(a, b) > 0) {  // a fixed axis is better if the features soon change
      Axis still = axis;
      still.rate = {};
      const double longer = certified_step(a, b, still, margin, left);
      if (longer > h) h = longer, axis = still;
    }
    if (h < left && turning > little_turn) {
      Axis fixed = axis;
      const double longer = spun_step(a, b, margin, &fixed);
      if (longer > h) h = longer, axis = fixed;
    }
    if (h < left) last = axis, before = t;
    return h;
  };
  if (!advance(a, b, start, end, limit, close, certified, &t)) return {t, false, axis.n};
  return {t, true, contact_normal(a, b, last, t - before, axis)};
}

}  // namespace tauguard::rigid
