#include "first_touch.hpp"

#include <algorithm>

#include "convex_contact.hpp"
#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {
namespace {

// If the sum of the radii is below this fraction of the bodies' size, the normal is too inaccurate
// for finding the touching features. It is the direction of the segment between the cores, whose
// ends have errors of up to 1e-9 of the size: the shorter the segment, the less accurate it is.
constexpr double small_radii = 1e-6;

// A point that both rounded bodies contain, on the segment between their cores.
Vec3 common_point(const MovingBody& a, const MovingBody& b) {
  const Nearest near = nearest(a.now, b.now);
  const Vec3 way = near.b - near.a;
  const double length = norm(way);
  if (!(length > 0) || near.size == 4) return 0.5 * (near.a + near.b);
  const double from = std::max(0.0, length - b.rounding), to = std::min(length, a.rounding);
  return near.a + (0.5 * (from + to) / length) * way;
}

}  // namespace

FirstTouch first_touch(const Impact& impact, MovingBody& a, MovingBody& b, const Vec3& origin) {
  if (!impact.hit) return no_touch;
  FirstTouch out = no_touch;
  out.toi = impact.t;
  a.move_to(impact.t), b.move_to(impact.t);
  double top = -INFINITY, bottom = INFINITY;
  for (const Vec3& p : a.now) top = std::max(top, dot(impact.normal, p));
  for (const Vec3& p : b.now) bottom = std::min(bottom, dot(impact.normal, p));
  const double tolerance = contact_tolerance(a, b), rounding = a.rounding + b.rounding;
  const bool along = norm(impact.normal) > 0 && bottom - top - rounding >= -tolerance;
  Vec3 point;
  if (!along || (rounding > 0 && rounding < small_radii * (a.radius() + b.radius()))) {
    point = common_point(a, b);  // the touching features are not known
  } else {
    point = contact_point(a.now, b.now, impact.normal, tolerance);
    if (rounding > 0) point = point + 0.5 * (a.rounding - b.rounding) * impact.normal;
  }
  for (int k = 0; k < 3; ++k) {
    out.point[k] = point[k] + origin[k];
    if (along) out.normal[k] = impact.normal[k];
  }
  return out;
}

namespace {

// Whether balls of the sum `reach` of both radii never meet, while b's centre moves from `between`,
// relative to a's, by `move`. Errors are relative to the distance, however far the bodies move.
bool never_near(const Vec3& between, const Vec3& move, double reach) {
  const double most = largest(move);
  Vec3 nearest = between;
  if (most > 0) {
    // Subnormal and huge lengths are scaled by powers of two, which is exact.
    const int e = std::ilogb(most);
    Vec3 u;
    for (int k = 0; k < 3; ++k) u[k] = std::ldexp(move[k], -e);
    const double length = norm(u);
    u = (1 / length) * u;
    const double along = dot(between, u);
    if (along < 0)
      nearest = std::ldexp(-along, -e) >= length ? between + move : between - along * u;
  }
  return norm(nearest) > reach * (1 + 0x1p-40) + 0x1p-40 * norm(between);
}

FirstTouch turned(FirstTouch t) {
  for (double& x : t.normal) x = -x;
  return t;
}

// As bodies_impact, for curved bodies and half-spaces.
FirstTouch supports_impact(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                           double radius_b, const RigidMotion& motion_a,
                           const RigidMotion& motion_b) {
  if (b.kind == Kind::half_spaces)
    return turned(supports_impact(b, a, row, radius_b, radius_a, motion_b, motion_a));
  geometry::Scratch<std::array<PlacedShape, 2>> placed;
  auto& [first, second] = *placed;
  place(a, row, radius_a, &first), place(b, row, radius_b, &second);
  const Vec3 origin = motion_b.x0 + motion_b.turn(second.frame.at);
  if (a.kind == Kind::half_spaces) {  // the point of the plane below the origin is its middle
    const Vec3 y = {first.frame.row[0][2], first.frame.row[1][2], first.frame.row[2][2]},
               n = motion_a.turn(y), from = origin - motion_a.x0;
    const Vec3 below = from - (dot(n, from) - dot(y, first.frame.at)) * n;
    first.frame.at =
        below[0] * motion_a.r0[0] + below[1] * motion_a.r0[1] + below[2] * motion_a.r0[2];
  }
  SupportShape x(first.shape, first.frame, motion_a, origin),
      y(second.shape, second.frame, motion_b, origin);
  if (!x.half_space()) {
    x.move_to(0), y.move_to(0);
    const double reach = x.reach() + x.radius() + y.reach() + y.radius();
    if (never_near(y.centre() - x.centre(), y.linear() - x.linear(), reach)) return no_touch;
  }
  const Touch touch = first_contact(x, y, 0, 0);
  if (!touch.hit) return no_touch;
  FirstTouch out = no_touch;
  out.toi = touch.t;
  const bool inside = touch.t == 0 && touch.distance < 0;  // no normal is defined
  Vec3 point = touch.point;
  if (inside && !x.half_space()) {
    const Distance d = distance_of(x, y, {}, INFINITY);
    point = 0.5 * (d.on_a + d.on_b);
    if (!d.overlap && d.upper > 0)
      point = d.on_a + 0.5 * (1 + (x.radius() - y.radius()) / d.upper) * (d.on_b - d.on_a);
  }
  for (int k = 0; k < 3; ++k) {
    out.point[k] = point[k] + origin[k];
    if (!inside) out.normal[k] = touch.normal[k];
  }
  return out;
}

}  // namespace

FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row, double rounding_a,
                         double rounding_b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b) {
  if (!is_polytope(a.kind) || !is_polytope(b.kind))
    return supports_impact(a, b, row, rounding_a, rounding_b, motion_a, motion_b);
  // Positions are relative to the first vertex of a at the start, so that scenes far from the world
  // origin lose no accuracy.
  const double* p = a.row(row);
  const Vec3 origin = motion_a.x0 + motion_a.turn({p[0], p[1], p[2]});
  MovingBody x = moving_body(a, row, motion_a, origin), y = moving_body(b, row, motion_b, origin);
  x.rounding = rounding_a, y.rounding = rounding_b;
  const double reach = x.radius() + y.radius() + rounding_a + rounding_b;
  if (never_near(motion_b.x0 - motion_a.x0, motion_b.linear - motion_a.linear, reach))
    return no_touch;
  return first_touch(first_contact(x, y, 0, 1), x, y, origin);
}

}  // namespace tauguard::rigid
