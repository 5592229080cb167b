#include "distance.hpp"

#include <algorithm>

namespace tauguard::contacts {
namespace {

struct Corner {
  Vec w, a, b;  // w = b - a
};

// Weights of the point of the affine hull of c[0..m) nearest to the origin; false where it is not
// inside.
bool nearest_inside(const Corner* c, int m, double* weight) {
  if (m == 1) return weight[0] = 1, true;
  Vec e[3];
  for (int i = 1; i < m; ++i) e[i - 1] = c[i].w - c[0].w;
  const Vec o = -1.0 * c[0].w;
  if (m == 2) {
    const double ee = dot(e[0], e[0]);
    if (!(ee > 0)) return false;
    weight[1] = dot(e[0], o) / ee;
  } else if (m == 3) {
    const Vec n = cross(e[0], e[1]);
    const double nn = dot(n, n);
    if (!(nn > 1e-24 * dot(e[0], e[0]) * dot(e[1], e[1]))) return false;
    weight[1] = dot(cross(o, e[1]), n) / nn;
    weight[2] = dot(cross(e[0], o), n) / nn;
  } else {
    const double det = dot(e[0], cross(e[1], e[2]));
    if (!(std::fabs(det) > 1e-14 * norm(e[0]) * norm(e[1]) * norm(e[2]))) return false;
    weight[1] = dot(o, cross(e[1], e[2])) / det;
    weight[2] = dot(e[0], cross(o, e[2])) / det;
    weight[3] = dot(e[0], cross(e[1], o)) / det;
  }
  weight[0] = 1;
  for (int i = 1; i < m; ++i) {
    if (weight[i] < 0) return false;
    weight[0] -= weight[i];
  }
  return weight[0] >= 0;
}

struct Nearest {
  Vec v{}, a{}, b{};
  double square = INFINITY;
};

// Keeps of c[0..m) the face nearest to the origin, among those that hold the newest corner.
bool reduce(Corner* c, int* m, Nearest* nearest) {
  const int n = *m;
  Nearest best;
  int kept = 0;
  for (int mask = 1 << (n - 1); mask < 1 << n; ++mask) {
    Corner face[4];
    int size = 0;
    for (int i = 0; i < n; ++i)
      if (mask >> i & 1) face[size++] = c[i];
    double weight[4];
    if (!nearest_inside(face, size, weight)) continue;
    Nearest here;
    for (int i = 0; i < size; ++i) {
      here.v = here.v + weight[i] * face[i].w;
      here.a = here.a + weight[i] * face[i].a;
      here.b = here.b + weight[i] * face[i].b;
    }
    here.square = dot(here.v, here.v);
    if (here.square < best.square) best = here, kept = mask;
  }
  if (kept == 0) return false;
  int size = 0;
  for (int i = 0; i < n; ++i)
    if (kept >> i & 1) c[size++] = c[i];
  *m = size;
  *nearest = best;
  return true;
}

Corner corner_along(const Mover& a, const Mover& b, const Vec& v) {
  Corner c;
  c.a = a.support(v), c.b = b.support(-1.0 * v);
  c.w = c.b - c.a;
  return c;
}

Distance of_half_space(const Mover& a, const Mover& b) {
  Distance d;
  d.n = a.plane_normal();
  d.on_b = b.support(-1.0 * d.n);
  d.lower = dot(d.n, d.on_b - a.middle());
  d.on_a = d.on_b - d.lower * d.n;
  d.upper = std::fabs(d.lower);
  d.overlap = d.lower < 0;
  return d;
}

}  // namespace

Distance distance_of(const Mover& a, const Mover& b, const Vec& guess, double needed) {
  if (a.half_space()) return of_half_space(a, b);
  Distance out;
  const auto attempt = [&](const Vec& direction, const Corner& c) {
    const double length = norm(direction);
    if (!(length > 0)) return;
    const double lower = dot(direction, c.w) / length;
    if (lower > out.lower) out.lower = lower, out.n = (1 / length) * direction;
  };
  Corner c[4];
  int m = 1;
  Vec first = guess;
  if (!(dot(first, first) > 0)) first = b.middle() - a.middle();
  if (!(dot(first, first) > 0)) first = {0, 0, 1};
  c[0] = corner_along(a, b, first);
  attempt(first, c[0]);
  Nearest nearest;
  nearest.v = c[0].w, nearest.a = c[0].a, nearest.b = c[0].b, nearest.square = dot(c[0].w, c[0].w);
  // Below this length v is rounding: 64 covers the dozen operations behind each coordinate of it.
  const double rounding = 64 * unit_roundoff * (a.magnitude() + b.magnitude());
  for (int iteration = 0; iteration < 100; ++iteration) {
    const Vec v = nearest.v;
    if (m == 4 || nearest.square <= rounding * rounding) {
      out.overlap = true;
      break;
    }
    Corner next = corner_along(a, b, v);
    attempt(v, next);
    const double length = std::sqrt(nearest.square);
    if (length - out.lower <= 1e-10 * length) break;
    if (out.lower > needed && length - out.lower < 0.1 * (out.lower - needed)) break;
    bool known = false;
    for (int i = 0; i < m; ++i) known = known || c[i].w == next.w;
    if (known) break;
    c[m++] = next;
    const Nearest before = nearest;
    if (!reduce(c, &m, &nearest) || nearest.square >= before.square) {
      nearest = before;
      break;
    }
  }
  // Close to contact the nearest point is all cancellation: the face of the last simplex has a
  // better normal.
  if (!out.overlap && m == 3) {
    Vec n = cross(c[1].w - c[0].w, c[2].w - c[0].w);
    if (dot(n, c[0].w) < 0) n = -1.0 * n;
    if (dot(n, n) > 0) attempt(n, corner_along(a, b, n));
  }
  out.upper = std::sqrt(nearest.square);
  out.on_a = nearest.a, out.on_b = nearest.b;
  out.corners = m;
  for (int i = 0; i < m; ++i) out.simplex[i] = c[i].w;
  return out;
}

}  // namespace tauguard::contacts
