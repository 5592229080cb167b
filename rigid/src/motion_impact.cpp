// Conservative advancement along separating directions that turn with the bodies.
//
// Take a time t, a unit n and any rate r, and let the direction be n(h) = n + h r. With
// s(h) = min_b n(h).x_b - max_a n(h).x_a at time t + h, the bodies are apart while s > 0, whatever n and r
// are. Measured from a's centre c, each projection is its tangent at h = 0 plus at most K h^2 / 2, where K
// bounds its second derivative |2 r.(x - c)' + n(h).x''|; so s(h) >= G(h) = min_b (tangent) -
// max_a (tangent) - (Ka + Kb) h^2 / 2 - rounding. G is concave and computable: the step goes to just before
// its root, and every time passed is certified. The direction is the best separating axis of time t and r its
// own rate of turning: then all vertices of the touching features keep one tangent, and the steps converge
// quadratically, as Newton's do, but from below. (With r = 0 a turning face tilts away from n and convergence
// is linear.)
#include "motion_impact.hpp"

#include <algorithm>

namespace tauguard::rigid {
namespace {

constexpr double unit_roundoff = 0x1p-53;
// A guard against creeping along a resting gap; the time reached is still never late.
constexpr int most_steps = 20000;

struct Axis {
  Vec n{}, rate{};
  double separation = -INFINITY;
};

double least(const std::vector<Vec>& points, const Vec& n) {
  double m = INFINITY;
  for (const Vec& p : points) m = std::min(m, dot(n, p));
  return m;
}

double most(const std::vector<Vec>& points, const Vec& n) {
  double m = -INFINITY;
  for (const Vec& p : points) m = std::max(m, dot(n, p));
  return m;
}

// Tries n and -n, n of length 1; true where one of them is the best so far.
bool consider(const MovingBody& a, const MovingBody& b, const Vec& n, Axis* best) {
  double a_lo = INFINITY, a_hi = -INFINITY, b_lo = INFINITY, b_hi = -INFINITY;
  for (const Vec& p : a.now) {
    const double x = dot(n, p);
    a_lo = std::min(a_lo, x), a_hi = std::max(a_hi, x);
  }
  for (const Vec& p : b.now) {
    const double x = dot(n, p);
    b_lo = std::min(b_lo, x), b_hi = std::max(b_hi, x);
  }
  const double forward = b_lo - a_hi, backward = a_lo - b_hi;
  if (!(std::max(forward, backward) > best->separation)) return false;
  *best = forward >= backward ? Axis{n, {}, forward} : Axis{-1.0 * n, {}, backward};
  return true;
}

Axis best_axis(const MovingBody& a, const MovingBody& b, double enough) {
  Axis best;
  int chosen = -1;  // 0: turns with a, 1: with b, 2: crossed edges x, y
  Vec x{}, y{};
  for (const Vec& n : a.normal)
    if (consider(a, b, n, &best)) chosen = 0;
  for (const Vec& n : b.normal)
    if (consider(a, b, n, &best)) chosen = 1;
  for (const Vec& ea : a.edge)
    for (const Vec& eb : b.edge) {
      const Vec n = cross(ea, eb);
      const double square = dot(n, n);
      if (square > 1e-24 && consider(a, b, (1 / std::sqrt(square)) * n, &best)) chosen = 2, x = ea, y = eb;
    }
  if (best.separation <= enough && !(a.complete && b.complete)) {
    Axis other;
    separating_direction(a.now, b.now, &other.n, &other.separation);
    if (other.separation > best.separation) {
      other.rate = cross(a.angular(), other.n);
      return other;
    }
  }
  if (chosen == 0) best.rate = cross(a.angular(), best.n);
  if (chosen == 1) best.rate = cross(b.angular(), best.n);
  if (chosen == 2) {
    const Vec c = cross(x, y), turned = cross(cross(a.angular(), x), y) + cross(x, cross(b.angular(), y));
    best.rate = (dot(c, best.n) < 0 ? -1 : 1) / norm(c) * (turned - dot(turned, best.n) * best.n);
  }
  return best;
}

// G and its slope at h, from the projections p + h v of both bodies.
class Lower {
 public:
  Lower(const MovingBody& a, const MovingBody& b, const Axis& axis, double horizon, double margin) : margin_(margin) {
    const double turn = norm(axis.rate) * (1 + 0x1p-40), drift = turn * horizon;
    const double speed_b = norm(b.linear() - a.linear()) * (1 + 0x1p-40) + b.turning_speed();
    half_k_ = turn * (a.turning_speed() + speed_b) +
              0.5 * (a.acceleration(axis.n, drift) + b.acceleration(axis.n, drift));
    project(a, axis, a.centre, a.linear(), &a_);
    project(b, axis, a.centre, a.linear(), &b_);
  }

  double operator()(double h, double* slope) const {
    double top = -INFINITY, bottom = INFINITY, top_v = 0, bottom_v = 0;
    for (const auto& [p, v] : a_)
      if (p + h * v > top) top = p + h * v, top_v = v;
    for (const auto& [p, v] : b_)
      if (p + h * v < bottom) bottom = p + h * v, bottom_v = v;
    *slope = bottom_v - top_v - 2 * half_k_ * h;
    return bottom - top - half_k_ * h * h - margin_;
  }

 private:
  using Tangents = std::vector<std::array<double, 2>>;

  static void project(const MovingBody& body, const Axis& axis, const Vec& centre, const Vec& drift, Tangents* out) {
    out->resize(body.now.size());
    for (std::size_t i = 0; i < body.now.size(); ++i) {
      const Vec x = body.now[i] - centre;
      (*out)[i] = {dot(axis.n, x), dot(axis.rate, x) + dot(axis.n, body.velocity[i] - drift)};
    }
  }

  Tangents a_, b_;
  double half_k_, margin_;
};

// The largest step found with G >= 0 on [0, step]; at_zero = G(0) > 0. Newton from the right stays right of
// the root of a concave function; the chord from (0, G(0)) to a point right of the root crosses zero left of it.
double safe_step(const Lower& g, double at_zero, double limit) {
  double slope, h = limit, value = g(h, &slope);
  if (value >= 0) return limit;
  for (int i = 0; i < 60 && value < -1e-6 * at_zero; ++i) {
    const double next = h - value / slope;
    if (!(next < h) || !(next > 0)) break;
    h = next;
    value = g(h, &slope);
  }
  return value >= 0 ? h : h * (at_zero / (at_zero - value)) * (1 - 4 * unit_roundoff);
}

}  // namespace

Impact first_contact(MovingBody& a, MovingBody& b, double start, double end, double gap) {
  // Rounding: a projection takes fewer than 40 operations on values up to `magnitude`, once for each body,
  // and again in the tangents; 128 covers both.
  const double margin = 128 * unit_roundoff * (a.magnitude() + b.magnitude());
  double t = start;
  Vec normal{};
  for (int step = 0; step < most_steps; ++step) {
    a.move_to(t), b.move_to(t);
    const Axis axis = best_axis(a, b, 2 * margin);
    if (axis.separation > -INFINITY) normal = axis.n;
    if (axis.separation <= 2 * margin + gap) return {t, true, normal};
    // Beyond the time that the direction takes to turn by a radian its tangent says nothing.
    const double turn = norm(axis.rate), left = end - t, horizon = turn * left > 1 ? 1 / turn : left;
    const Lower lower(a, b, axis, horizon, margin);
    const double h = safe_step(lower, axis.separation - margin, horizon);
    if (h >= left) return {end, false, normal};
    if (t + h <= t) return {t, true, normal};
    t += h;
  }
  return {t, true, normal};
}

MovingBody moving_body(const Bodies& bodies, std::size_t r, const RigidMotion& motion, const Vec& origin) {
  MovingBody body(motion, origin);
  const Points<double> v = vertices_of<double>(bodies, r);
  for (const Vec& p : v) body.add_vertex(p);
  const double* row = bodies.row(r);
  if (bodies.kind == Kind::boxes) {
    for (int k = 0; k < 3; ++k) {
      const Vec axis = {row[6 + k], row[9 + k], row[12 + k]};
      body.add_normal(axis), body.add_edge(axis);
    }
  } else if (bodies.kind == Kind::parallelepipeds) {
    const Vec e[3] = {{row[3], row[4], row[5]}, {row[6], row[7], row[8]}, {row[9], row[10], row[11]}};
    for (int k = 0; k < 3; ++k) body.add_normal(cross(e[k], e[(k + 1) % 3])), body.add_edge(e[k]);
    body.complete = std::fabs(dot(e[0], cross(e[1], e[2]))) > 1e-9 * norm(e[0]) * norm(e[1]) * norm(e[2]);
  } else if (bodies.kind == Kind::tetrahedra) {
    for (int i = 0; i < 4; ++i)
      for (int j = i + 1; j < 4; ++j) {
        body.add_edge(v[j] - v[i]);
        for (int k = j + 1; k < 4; ++k) body.add_normal(cross(v[j] - v[i], v[k] - v[i]));
      }
    const Vec x = v[1] - v[0], y = v[2] - v[0], z = v[3] - v[0];
    body.complete = std::fabs(dot(x, cross(y, z))) > 1e-9 * norm(x) * norm(y) * norm(z);
  } else {
    body.complete = false;
  }
  return body;
}

MovingBody moving_triangle(const double v[3][3], const RigidMotion& motion, const Vec& origin) {
  MovingBody body(motion, origin);
  Vec p[3];
  for (int i = 0; i < 3; ++i) p[i] = {v[i][0], v[i][1], v[i][2]}, body.add_vertex(p[i]);
  const Vec n = cross(p[1] - p[0], p[2] - p[0]);
  body.add_normal(n);
  for (int i = 0; i < 3; ++i) {
    const Vec e = p[(i + 1) % 3] - p[i];
    body.add_edge(e), body.add_normal(cross(e, n));
  }
  body.complete = norm(n) > 1e-9 * norm(p[1] - p[0]) * norm(p[2] - p[0]);
  return body;
}

MovingBody moving_box(const Vec& centre, const Vec& extent, const RigidMotion& motion, const Vec& origin) {
  MovingBody body(motion, origin);
  for (int corner = 0; corner < 8; ++corner) {
    Vec p = centre;
    for (int k = 0; k < 3; ++k) p[k] += (corner >> k & 1 ? 1 : -1) * extent[k];
    body.add_vertex(p);
  }
  for (int k = 0; k < 3; ++k) {
    Vec axis{};
    axis[k] = 1;
    body.add_normal(axis), body.add_edge(axis);
  }
  return body;
}

namespace {

// The point of the affine hull of w[0..m) nearest to the origin, if it lies inside the simplex.
bool nearest_inside(const Vec* w, int m, Vec* point) {
  if (m == 1) return *point = w[0], true;
  const Vec e[3] = {w[1] - w[0], m > 2 ? w[2] - w[0] : Vec{}, m > 3 ? w[3] - w[0] : Vec{}};
  double l[3];
  if (m == 2) {
    const double ee = dot(e[0], e[0]);
    if (!(ee > 0)) return false;
    l[0] = -dot(e[0], w[0]) / ee;
  } else if (m == 3) {
    const double aa = dot(e[0], e[0]), ab = dot(e[0], e[1]), bb = dot(e[1], e[1]);
    const double det = aa * bb - ab * ab, x = -dot(e[0], w[0]), y = -dot(e[1], w[0]);
    if (!(det > 1e-24 * aa * bb)) return false;
    l[0] = (x * bb - y * ab) / det, l[1] = (y * aa - x * ab) / det;
  } else {
    const double det = dot(e[0], cross(e[1], e[2]));
    if (!(std::fabs(det) > 1e-14 * norm(e[0]) * norm(e[1]) * norm(e[2]))) return false;
    const Vec o = -1.0 * w[0];
    l[0] = dot(o, cross(e[1], e[2])) / det;
    l[1] = dot(e[0], cross(o, e[2])) / det;
    l[2] = dot(e[0], cross(e[1], o)) / det;
  }
  double rest = 1;
  *point = w[0];
  for (int i = 0; i + 1 < m; ++i) {
    if (l[i] < 0) return false;
    rest -= l[i];
    *point = *point + l[i] * e[i];
  }
  return rest >= 0;
}

// Replaces the simplex by its face nearest to the origin among those that hold the newest corner.
bool reduce(Vec* w, int* m, Vec* v) {
  const int n = *m;
  double best = INFINITY;
  int kept = 0;
  for (int mask = 1 << (n - 1); mask < 1 << n; ++mask) {
    Vec face[4], p;
    int size = 0;
    for (int i = 0; i < n; ++i)
      if (mask >> i & 1) face[size++] = w[i];
    if (nearest_inside(face, size, &p) && dot(p, p) < best) best = dot(p, p), kept = mask, *v = p;
  }
  int size = 0;
  for (int i = 0; i < n; ++i)
    if (kept >> i & 1) w[size++] = w[i];
  *m = size;
  return size > 0;
}

}  // namespace

// Gilbert, Johnson and Keerthi 1988 on b - a. Close to contact the nearest point itself is all cancellation,
// so the normals of the last simplex's triangles are tried as well; the best of them wins.
bool separating_direction(const std::vector<Vec>& a, const std::vector<Vec>& b, Vec* n, double* separation) {
  *separation = -INFINITY;
  const auto attempt = [&](const Vec& d) {
    const double length = norm(d);
    if (!(length > 0)) return;
    for (const double sign : {1.0, -1.0}) {
      const Vec u = (sign / length) * d;
      const double s = least(b, u) - most(a, u);
      if (s > *separation) *separation = s, *n = u;
    }
  };
  Vec w[5], v = b[0] - a[0];
  int m = 1;
  w[0] = v;
  for (int iteration = 0; iteration < 100; ++iteration) {
    attempt(v);
    if (m == 3) attempt(cross(w[1] - w[0], w[2] - w[0]));
    if (m == 4 || !(dot(v, v) > 0)) break;
    const auto far_a = std::max_element(a.begin(), a.end(), [&](auto& x, auto& y) { return dot(v, x) < dot(v, y); });
    const auto far_b = std::min_element(b.begin(), b.end(), [&](auto& x, auto& y) { return dot(v, x) < dot(v, y); });
    const Vec next = *far_b - *far_a;
    if (dot(v, v) - dot(v, next) <= 1e-14 * dot(v, v)) break;
    if (std::find(w, w + m, next) != w + m) break;
    w[m++] = next;
    Vec all[4];
    std::copy(w, w + m, all);
    const int size = m;
    const double before = dot(v, v);
    if (!reduce(w, &m, &v) || dot(v, v) >= before) {
      for (int skip = 0; size == 4 && skip < 4; ++skip)
        attempt(cross(all[(skip + 1) % 4] - all[skip], all[(skip + 2) % 4] - all[skip]));
      if (size == 3) attempt(cross(all[1] - all[0], all[2] - all[0]));
      break;
    }
  }
  return *separation > 0;
}

}  // namespace tauguard::rigid
