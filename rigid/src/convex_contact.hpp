// A common point of two bodies that touch along a known normal. The contact feature of a body is
// the polygon of its vertices within `tolerance` of the contact plane. The point is in the
// intersection of both polygons.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "tauguard/geometry/scratch.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

class ContactFeature {
 public:
  using Point2 = std::array<double, 2>;
  using Polygon = std::vector<Point2>;

  // Takes the vertices of `body` that are extreme along sign * normal, as a convex polygon in u, v.
  void find(const Points<double>& body, const Vec3& normal, double sign, double tolerance,
            const Vec3& u, const Vec3& v) {
    double top = sign * dot(normal, body[0]);
    for (const auto& p : body) top = std::max(top, sign * dot(normal, p));
    polygon.clear();
    for (const auto& p : body)
      if (sign * dot(normal, p) >= top - tolerance) polygon.push_back({dot(u, p), dot(v, p)});
    level = sign * top;
    make_convex(&polygon);
  }

  // The mean of the intersection's corners. If rounding leaves no intersection, the middle between
  // the means of the two polygons.
  static Point2 meet(const ContactFeature& a, const ContactFeature& b, double tolerance) {
    geometry::Scratch<Polygon> rest;
    intersect(a, b, tolerance, &*rest);
    if (!rest->empty()) return mean(*rest);
    const Point2 x = mean(a.polygon), y = mean(b.polygon);
    return {0.5 * (x[0] + y[0]), 0.5 * (x[1] + y[1])};
  }

  // The intersection of two polygons, of which each may be a segment; a single point stays.
  static void intersect(const ContactFeature& a, const ContactFeature& b, double tolerance,
                        Polygon* out) {
    Polygon& rest = *out;
    rest.clear();
    if (a.polygon.size() == 1) return void(rest = a.polygon);
    if (b.polygon.size() == 1) return void(rest = b.polygon);
    const bool a_cuts = a.polygon.size() >= b.polygon.size();
    const Polygon& cutter = a_cuts ? a.polygon : b.polygon;
    geometry::Scratch<std::array<Polygon, 1>> scratch;
    Polygon& before = (*scratch)[0];
    rest = a_cuts ? b.polygon : a.polygon;
    for (std::size_t i = 0; i < cutter.size() && !rest.empty(); ++i) {
      std::swap(rest, before);
      cut(before, cutter[i], cutter[(i + 1) % cutter.size()], tolerance, &rest);
    }
    for (int end = 0; end < 2 && cutter.size() == 2 && !rest.empty(); ++end) {
      // A segment also ends at a line across each of its ends.
      const Point2 &x = cutter[end], &y = cutter[1 - end];
      std::swap(rest, before);
      cut(before, x, {x[0] + (y[1] - x[1]), x[1] - (y[0] - x[0])}, tolerance, &rest);
    }
  }

  double level = 0.0;
  Polygon polygon;

  static double turn(const Point2& o, const Point2& p, const Point2& q) {
    return (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0]);
  }

  // Counter-clockwise convex hull (Andrew's monotone chain).
  static void make_convex(Polygon* points) {
    Polygon& p = *points;
    if (p.size() == 1) return;
    std::sort(p.begin(), p.end());
    p.erase(std::unique(p.begin(), p.end()), p.end());
    if (p.size() < 3) return;
    geometry::Scratch<Polygon> scratch;
    Polygon& out = *scratch;
    out.clear();
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
    std::swap(p, out);
  }

 private:
  // Writes the part of the polygon that is left of the line o -> e or within `tolerance` of it.
  static void cut(const Polygon& p, const Point2& o, const Point2& e, double tolerance,
                  Polygon* out) {
    const double length = std::hypot(e[0] - o[0], e[1] - o[1]);
    const auto inside = [&](const Point2& x) { return turn(o, e, x) + tolerance * length; };
    out->clear();
    for (std::size_t i = 0; i < p.size(); ++i) {
      const Point2 &x = p[i], &y = p[(i + 1) % p.size()];
      const double fx = inside(x), fy = inside(y);
      if (fx >= 0) out->push_back(x);
      if ((fx > 0 && fy < 0) || (fx < 0 && fy > 0)) {
        const double s = fx / (fx - fy);
        out->push_back({x[0] + s * (y[0] - x[0]), x[1] + s * (y[1] - x[1])});
      }
    }
  }

  static Point2 mean(const Polygon& p) {
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
  geometry::Scratch<std::array<ContactFeature, 2>> scratch;
  ContactFeature &fa = (*scratch)[0], &fb = (*scratch)[1];
  fa.find(a, normal, 1.0, tolerance, u, v), fb.find(b, normal, -1.0, tolerance, u, v);
  const auto at = ContactFeature::meet(fa, fb, tolerance);
  return at[0] * u + at[1] * v + 0.5 * (fa.level + fb.level) * normal;
}

}  // namespace tauguard::rigid
