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

FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row, double rounding_a,
                         double rounding_b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b) {
  // Positions are relative to the first vertex of a at the start, so that scenes far from the world
  // origin lose no accuracy.
  const double* p = a.row(row);
  const Vec3 origin = motion_a.x0 + motion_a.turn({p[0], p[1], p[2]});
  MovingBody x = moving_body(a, row, motion_a, origin), y = moving_body(b, row, motion_b, origin);
  x.rounding = rounding_a, y.rounding = rounding_b;
  return first_touch(first_contact(x, y, 0, 1), x, y, origin);
}

}  // namespace tauguard::rigid
