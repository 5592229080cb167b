#include "comparators.hpp"

#include <limits>

namespace tauguard::cloth {
namespace {

// Slack of the barycentric weights at a root: what the published codes use, about.
constexpr double inside_tolerance = 1e-10;

int variations(const double* a) {
  int count = 0;
  double last = 0;
  for (int i = 0; i < 4; ++i) {
    if (a[i] == 0) continue;
    count += last * a[i] < 0 || (last != 0 && (last > 0) != (a[i] > 0));
    last = a[i];
  }
  return count;
}

// Coefficients in powers of t of the cubic with these Bernstein coefficients.
void powers(const double* b, double* a) {
  a[0] = b[0];
  a[1] = 3 * (b[1] - b[0]);
  a[2] = 3 * (b[2] - 2 * b[1] + b[0]);
  a[3] = b[3] - 3 * b[2] + 3 * b[1] - b[0];
}

Cubic part(const Cubic& c, double from, double to) {
  Cubic left, right, rest;
  halve(c, from, left, rest);
  halve(rest, from < 1 ? (to - from) / (1 - from) : 1, left, right);
  return left;
}

bool inside(const Query& k, double t, bool vf) {
  const Vec3 p = mix(k.p[0], k.p[1], t), q = mix(k.q[0], k.q[1], t), r = mix(k.r[0], k.r[1], t);
  const Vec3 n = cross(q, r);
  const double nn = dot(n, n);
  if (nn == 0) return false;
  const double low = -inside_tolerance, high = 1 + inside_tolerance;
  const double v = dot(cross(p, r), n) / nn;
  const double w = vf ? dot(cross(q, p), n) / nn : dot(cross(p, q), n) / nn;
  return v >= low && w >= low && (vf ? v + w <= high : v <= high && w <= high);
}

}  // namespace

bool filtered_out(const Cubic& c, Method method) {
  double a[4];
  switch (method) {
    case Method::dnf:
      return one_sign(c, 0) != 0;
    case Method::vcd:
      return variations(c.b) == 0 && c.b[0] != 0 && c.b[3] != 0;
    case Method::scd: {
      powers(c.b, a);
      if (variations(a) == 0 && a[0] != 0) return true;
      const double reversed[4] = {c.b[3], c.b[2], c.b[1], c.b[0]};
      powers(reversed, a);
      return variations(a) == 0 && a[0] != 0;
    }
    default:
      return false;
  }
}

double first_root_inside(const Query& k, const Cubic& c, Method method, bool vf) {
  double cut[4] = {0, 1, 1, 1};
  int cuts = 1;
  if (!(method == Method::vcd && variations(c.b) == 1)) {
    // Split where the derivative vanishes: every piece is monotone.
    double a[4];
    powers(c.b, a);
    const double d = a[2] * a[2] - 3 * a[1] * a[3];
    if (d > 0) {
      const double s = -(a[2] + std::copysign(std::sqrt(d), a[2]));
      double x = s / (3 * a[3]), y = a[1] / s;
      if (x > y) std::swap(x, y);
      for (const double z : {x, y})
        if (z > 0 && z < 1) cut[cuts++] = z;
    }
  }
  cut[cuts] = 1;
  for (int i = 0; i < cuts; ++i) {
    const Cubic piece = cuts == 1 ? c : part(c, cut[i], cut[i + 1]);
    const double *b = piece.b, width = cut[i + 1] - cut[i];
    if (b[0] == 0 && inside(k, cut[i], vf)) return cut[i];
    if ((b[0] < 0 && b[3] > 0) || (b[0] > 0 && b[3] < 0)) {
      const double t = cut[i] + width * root(b);
      if (inside(k, t, vf)) return t;
    }
    if (b[3] == 0 && inside(k, cut[i + 1], vf)) return cut[i + 1];
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace tauguard::cloth
