#include "manifold.hpp"

#include <algorithm>

#include "convex_contact.hpp"
#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::rigid {
namespace {

constexpr double flat = 0.0524;  // sine of the largest tilt of a contact feature, 3 degrees
constexpr int rim_points = 16;   // of a cap

using Point2 = ContactFeature::Point2;

// The points of a rim, and of the line of a side, in the frame of the shape.
void add_rim(const Shape& s, double z, Points<double>* out) {
  for (int k = 0; k < rim_points; ++k) {
    const double angle = 2 * M_PI * k / rim_points;
    out->push_back({s.size[0] * std::cos(angle), s.size[0] * std::sin(angle), z});
  }
}

// The corners of the feature of a body that is furthest along n, relative to `origin`.
void feature_points(const Bodies& bodies, std::size_t row, const Vec3& n, const Vec3& origin,
                    Points<double>* out) {
  out->clear();
  if (is_polytope(bodies.kind)) {
    geometry::Scratch<Points<double>> scratch;
    Points<double>& all = *scratch;
    local_points(bodies, row, origin, &all);
    const Vec3* top = &all[0];
    for (const Vec3& p : all)
      if (dot(n, p) > dot(n, *top)) top = &p;
    for (const Vec3& p : all) {
      const Vec3 e = *top - p;
      if (dot(n, e) <= flat * norm(e)) out->push_back(p);
    }
    return;
  }
  geometry::Scratch<PlacedShape> placed;
  place(bodies, row, 0, &*placed);
  const Shape& s = placed->shape;
  const Vec3 d = placed->frame.back(n);
  const double across = std::hypot(d[0], d[1]), length = norm(d);
  const bool cone = s.kind == Kind::cones;
  if (s.kind != Kind::ellipsoids) {
    // The normal of the side makes this sine with n; the side of a cone is inclined.
    const double slant = std::hypot(s.size[0], 2 * s.size[1]);
    const double off_side =
        cone ? (2 * s.size[1] * d[2] - s.size[0] * across) / (slant * length) : d[2] / length;
    if (across <= flat * length && (d[2] < 0 || !cone))
      add_rim(s, d[2] < 0 ? -s.size[1] : s.size[1], out);
    else if (std::fabs(off_side) <= flat && across > 0) {
      const Vec3 rim = {s.size[0] * d[0] / across, s.size[0] * d[1] / across, 0};
      out->push_back({rim[0], rim[1], -s.size[1]});
      out->push_back(cone ? Vec3{0, 0, s.size[1]} : Vec3{rim[0], rim[1], s.size[1]});
    }
  }
  if (out->empty()) out->push_back(s.support(d));
  for (Vec3& p : *out) p = placed->frame.out(p) - origin;
}

// A feature seen along n, and its height over the plane across n.
class Patch {
 public:
  void set(const Points<double>& points, const Vec3& u, const Vec3& v, const Vec3& n) {
    feature.polygon.clear();
    for (const Vec3& p : points) feature.polygon.push_back({dot(u, p), dot(v, p)});
    ContactFeature::make_convex(&feature.polygon);
    fit(points, u, v, n);
  }
  double height(const Point2& x) const {
    return level_ + slope_[0] * (x[0] - foot_[0]) + slope_[1] * (x[1] - foot_[1]);
  }
  ContactFeature feature;

 private:
  // The plane through the points by least squares, through the line if they are in a line.
  void fit(const Points<double>& points, const Vec3& u, const Vec3& v, const Vec3& n) {
    Vec3 mean{};
    for (const Vec3& p : points) mean += p;
    mean = (1.0 / static_cast<double>(points.size())) * mean;
    foot_ = {dot(u, mean), dot(v, mean)}, level_ = dot(n, mean);
    double xx = 0, xy = 0, yy = 0, xh = 0, yh = 0;
    for (const Vec3& p : points) {
      const Vec3 e = p - mean;
      const double x = dot(u, e), y = dot(v, e), h = dot(n, e);
      xx += x * x, xy += x * y, yy += y * y, xh += x * h, yh += y * h;
    }
    const double det = xx * yy - xy * xy, trace = xx + yy;
    slope_ = {0, 0};
    if (det > 1e-12 * trace * trace)
      slope_ = {(xh * yy - yh * xy) / det, (yh * xx - xh * xy) / det};
    else if (trace > 0)
      slope_ = {xh / trace, yh / trace};
  }

  Point2 foot_{}, slope_{};
  double level_ = 0;
};

struct Candidate {
  Point2 at;
  double low, high;  // heights of a and b
  double distance() const { return high - low; }
};

// Keeps four candidates: the deepest, the furthest from it, and those furthest to both sides.
void reduce(std::vector<Candidate>* points) {
  std::vector<Candidate>& p = *points;
  const auto keep = [&](std::size_t place, const auto& measure) {
    std::size_t best = place;
    for (std::size_t i = place + 1; i < p.size(); ++i)
      if (measure(p[i]) > measure(p[best])) best = i;
    std::swap(p[place], p[best]);
  };
  keep(0, [](const Candidate& c) { return -c.distance(); });
  if (p.size() <= Manifold::most) return;
  keep(1,
       [&](const Candidate& c) { return std::hypot(c.at[0] - p[0].at[0], c.at[1] - p[0].at[1]); });
  const Point2 o = p[0].at, e = p[1].at;
  keep(2, [&](const Candidate& c) { return ContactFeature::turn(o, e, c.at); });
  keep(3, [&](const Candidate& c) { return -ContactFeature::turn(o, e, c.at); });
  p.resize(Manifold::most);
}

// The corners of a feature on a half-space, or of the intersection of two features.
void corners_of(const Patch& a, const Patch& b, double tolerance, bool on_plane,
                ContactFeature::Polygon* out) {
  if (on_plane)
    *out = b.feature.polygon;
  else
    ContactFeature::intersect(a.feature, b.feature, tolerance, out);
}

}  // namespace

Manifold manifold_of(const Bodies& a, const Bodies& b, std::size_t row, double radius_a,
                     double radius_b, double margin, const SignedDistance& g) {
  Manifold out;
  if (!(g.distance <= margin)) return out;
  if (b.kind == Kind::half_spaces) {
    const SignedDistance turned{g.distance, g.point_b, g.point_a, -1.0 * g.normal};
    out = manifold_of(b, a, row, radius_b, radius_a, margin, turned);
    for (int k = 0; k < out.count; ++k) std::swap(out.on_a[k], out.on_b[k]);
    return out;
  }
  const bool on_plane = a.kind == Kind::half_spaces;
  const Vec3 n = g.normal, origin = g.point_b;
  Vec3 side{};
  side[geometry::smallest_axis(n)] = 1;
  const Vec3 e = cross(n, side), u = (1 / norm(e)) * e, v = cross(n, u);
  geometry::Scratch<Points<double>> points;
  Patch first, second;
  if (on_plane)
    *points = {g.point_a - radius_a * n - origin};
  else
    feature_points(a, row, n, origin, &*points);
  first.set(*points, u, v, n);
  feature_points(b, row, -1.0 * n, origin, &*points);
  double size = 0;
  for (const Vec3& p : *points) size = std::max(size, norm(p));
  second.set(*points, u, v, n);
  ContactFeature::Polygon corners;
  corners_of(first, second, 1e-11 * size, on_plane, &corners);
  std::vector<Candidate> found;
  for (const Point2& x : corners) {
    const Candidate c{x, first.height(x) + radius_a, second.height(x) - radius_b};
    const bool again = std::any_of(found.begin(), found.end(), [&](const Candidate& other) {
      return std::hypot(other.at[0] - x[0], other.at[1] - x[1]) <= 1e-9 * size;
    });
    if (c.distance() <= margin && !again) found.push_back(c);
  }
  if (!found.empty()) reduce(&found);
  // The nearest or deepest points are always among the contacts.
  const double slack = 1e-6 * (size + std::fabs(g.distance));
  if (found.empty() || found[0].distance() > g.distance + slack ||
      found[0].distance() < g.distance - slack) {
    const Vec3 p = g.point_a - origin, q = g.point_b - origin;
    const double level = dot(n, p);
    for (Candidate& c : found)  // a tilted feature may reach beyond the deepest point
      if (c.distance() < g.distance) c.low = level, c.high = level + g.distance;
    if (found.size() == Manifold::most) found.pop_back();
    found.insert(found.begin(), {{dot(u, q), dot(v, q)}, level, level + g.distance});
  }
  for (const Candidate& c : found) {
    const Vec3 at = origin + c.at[0] * u + c.at[1] * v;
    out.on_a[out.count] = at + c.low * n, out.on_b[out.count] = at + c.high * n;
    out.distance[out.count++] = c.distance();
  }
  return out;
}

}  // namespace tauguard::rigid
