// A common point of two bodies that touch along a known normal. The contact feature of a body is
// the polygon of its vertices within `tolerance` of the contact plane. The point is in the
// intersection of both polygons.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

class ContactFeature {
 public:
  using Point2 = std::array<double, 2>;

  // The vertices of `body` that are extreme along sign * normal, as a convex polygon in u, v.
  ContactFeature(const Points<double>& body, const Vec3& normal, double sign, double tolerance,
                 const Vec3& u, const Vec3& v) {
    double top = sign * dot(normal, body[0]);
    for (const auto& p : body) top = std::max(top, sign * dot(normal, p));
    std::vector<Point2> points;
    for (const auto& p : body)
      if (sign * dot(normal, p) >= top - tolerance) points.push_back({dot(u, p), dot(v, p)});
    level = sign * top;
    polygon = hull(points);
  }

  // The mean of the intersection's corners. If rounding leaves no intersection, the middle between
  // the means of the two polygons.
  static Point2 meet(const ContactFeature& a, const ContactFeature& b, double tolerance) {
    if (a.polygon.size() == 1) return a.polygon[0];
    if (b.polygon.size() == 1) return b.polygon[0];
    const bool a_cuts = a.polygon.size() >= b.polygon.size();
    const auto& cutter = a_cuts ? a.polygon : b.polygon;
    std::vector<Point2> rest = a_cuts ? b.polygon : a.polygon;
    for (std::size_t i = 0; i < cutter.size() && !rest.empty(); ++i)
      rest = cut(rest, cutter[i], cutter[(i + 1) % cutter.size()], tolerance);
    if (!rest.empty()) return mean(rest);
    const Point2 x = mean(a.polygon), y = mean(b.polygon);
    return {0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])};
  }

  double level = 0.0;
  std::vector<Point2> polygon;

 private:
  static double turn(const Point2& o, const Point2& p, const Point2& q) {
    return (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0]);
  }

  // Counter-clockwise convex hull (Andrew's monotone chain).
  static std::vector<Point2> hull(std::vector<Point2> p) {
    std::sort(p.begin(), p.end());
    p.erase(std::unique(p.begin(), p.end()), p.end());
    if (p.size() < 3) return p;
    std::vector<Point2> out;
    for (int side = 0; side < 2; ++side) {
      const std::size_t start = out.size();
      for (const auto& x : p) {
        while (out.size() >= start + 2 && turn(out[out.size() - 2], out.back(), x) <= 0)
          out.pop_back();
        out.push_back(x);
      }
      out.pop_back();
      std::reverse(p.begin(), p.end());
    }
    return out;
  }

  // The part of the polygon that is left of the line o -> e or within `tolerance` of it.
  static std::vector<Point2> cut(const std::vector<Point2>& p, const Point2& o, const Point2& e,
                                 double tolerance) {
    const double length = std::hypot(e[0] - o[0], e[1] - o[1]);
    const auto inside = [&](const Point2& x) { return turn(o, e, x) + tolerance * length; };
    std::vector<Point2> out;
    for (std::size_t i = 0; i < p.size(); ++i) {
      const Point2 &x = p[i], &y = p[(i + 1) % p.size()];
      const double fx = inside(x), fy = inside(y);
      if (fx >= 0) out.push_back(x);
      if ((fx > 0 && fy < 0) || (fx < 0 && fy > 0)) {
        const double s = fx / (fx - fy);
        out.push_back({x[0] + s * (y[0] - x[0]), x[1] + s * (y[1] - x[1])});
      }
    }
    return out;
  }

  static Point2 mean(const std::vector<Point2>& p) {
    Point2 sum{};
    for (const auto& x : p) sum = {sum[0] + x[0], sum[1] + x[1]};
    const auto n = static_cast<double>(p.size());
    return {sum[0] / n, sum[1] / n};
  }
};

// A common point of `a` and `b`, which touch along the unit `normal` (from a to b).
inline Vec3 contact_point(const Points<double>& a, const Points<double>& b, const Vec3& normal,
                          double tolerance) {
  const int least = geometry::smallest_axis(normal);
  Vec3 u = -normal[least] * normal;
  u[least] += 1;
  const double length = norm(u);
  for (double& x : u) x /= length;
  const Vec3 v = cross(normal, u);
  const ContactFeature fa(a, normal, 1.0, tolerance, u, v), fb(b, normal, -1.0, tolerance, u, v);
  const auto at = ContactFeature::meet(fa, fb, tolerance);
  return at[0] * u + at[1] * v + 0.5 * (fa.level + fb.level) * normal;
}

}  // namespace tauguard::rigid
