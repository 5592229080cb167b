// At the first contact of two features in one plane, a vertex of one reaches an edge of the other.
// The line of the edge passes through the vertex at a root of a quadratic. There is contact if the
// vertex is between the ends of the edge at this time.
#include "sliding_contact.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tauguard::cloth {
namespace {

constexpr double none = std::numeric_limits<double>::infinity(),
                 hidden = std::numeric_limits<double>::quiet_NaN();
// Rows of a vertex and the two ends of an edge that it may reach.
constexpr int reaches_of_vf[][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
constexpr int reaches_of_ee[][3] = {{0, 2, 3}, {1, 2, 3}, {2, 0, 1}, {3, 0, 1}};

// A root is accepted only if it is certainly within this distance of its estimate.
constexpr double around = 0x1p-40;

struct Flat {
  double x, y;
};
double cross(Flat a, Flat b) { return a.x * b.y - a.y * b.x; }
double dot(Flat a, Flat b) { return a.x * b.x + a.y * b.y; }
Flat mix(Flat a, Flat b, double t) { return {(1 - t) * a.x + t * b.x, (1 - t) * a.y + t * b.y}; }
double largest(Flat a) { return std::max(std::fabs(a.x), std::fabs(a.y)); }

// The time at which a point reaches an edge, `none`, or `hidden` if rounding prevents a decision. u
// and v are the ends of the edge relative to the point, at both ends of the step. Let M be the
// product of their largest coordinates and eps = 2^-53. Errors are at most
//   eps         of a difference (relative),
//   8 eps M     of a cross or dot product of two differences,
//   12 eps M    of the middle coefficient,
//   32 eps M    of a value of the quadratic, a sum of three products with positive weights.
// `error` is eight times the last error, 2^-45 M.
double reach(const Flat (&u)[2], const Flat (&v)[2]) {
  const auto apart = [](double a, double b, double c, double d) {
    return (a > 0 && b > 0 && c > 0 && d > 0) || (a < 0 && b < 0 && c < 0 && d < 0);
  };
  if (apart(u[0].x, u[1].x, v[0].x, v[1].x) || apart(u[0].y, u[1].y, v[0].y, v[1].y)) return none;
  const double size =
      std::max(largest(u[0]), largest(u[1])) * std::max(largest(v[0]), largest(v[1]));
  if (!(size > 1e-250 && size < 1e250)) return hidden;
  const double error = 0x1p-45 * size;
  double b0 = cross(u[0], v[0]), b1 = 0.5 * (cross(u[0], v[1]) + cross(u[1], v[0])),
         b2 = cross(u[1], v[1]);
  if (std::min({b0, b1, b2}) > error || std::max({b0, b1, b2}) < -error) return none;
  if (b0 < 0) b0 = -b0, b1 = -b1, b2 = -b2;
  if (!(b0 > error && b2 < -error)) return hidden;
  // There is one root. For b1 > 0 this form avoids the cancellation in b0 - b1 + s.
  const double s = std::sqrt(b1 * b1 - b0 * b2);
  const double t = b0 / (b1 > 0 ? b0 - b0 * b2 / (s + b1) : b0 - b1 + s);
  const double before = std::max(t - around, 0.0), after = std::min(t + around, 1.0);
  const auto value = [&](double at) {
    const double left = 1 - at;
    return left * left * b0 + 2 * at * left * b1 + at * at * b2;
  };
  if (!(value(before) > error && value(after) < -error)) return hidden;
  // Contact if the ends are on opposite sides of the point. Between `before` and `after` the
  // product changes by at most 8 M per unit of time.
  const double ends = dot(mix(u[0], u[1], t), mix(v[0], v[1], t));
  if (!(std::fabs(ends) > 0x1p-35 * size)) return hidden;
  return ends < 0 ? before : none;
}

}  // namespace

double sliding_contact(bool vf, const Ends& x, const std::int32_t* row) {
  const auto same = [&](bool end, int k) {
    const double level = x.at(end, row[0])[k];
    return x.at(end, row[1])[k] == level && x.at(end, row[2])[k] == level &&
           x.at(end, row[3])[k] == level;
  };
  int k = 0;
  while (k < 3 && !(same(false, k) && same(true, k))) ++k;
  if (k == 3) return hidden;
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  const auto seen = [&](bool end, int a, int from) {
    const double *p = x.at(end, row[a]), *o = x.at(end, row[from]);
    return Flat{p[i] - o[i], p[j] - o[j]};
  };
  double first = none;
  for (int c = 0; c < (vf ? 3 : 4); ++c) {
    const int* r = vf ? reaches_of_vf[c] : reaches_of_ee[c];
    const Flat u[2] = {seen(false, r[1], r[0]), seen(true, r[1], r[0])},
               v[2] = {seen(false, r[2], r[0]), seen(true, r[2], r[0])};
    const double t = reach(u, v);
    if (std::isnan(t)) return hidden;
    first = std::min(first, t);
  }
  return first;
}

}  // namespace tauguard::cloth
