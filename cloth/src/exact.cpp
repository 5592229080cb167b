// The features touch at time t if the convex hull of their differences g_i(t) contains the origin.
// There are three differences for a vertex and a face, and four (a parallelogram) for two edges.
// The first time of contact is one of these:
// * 0, or a root of the coplanarity cubic.
// * If the cubic is zero at all times, the features stay in one plane, which may turn. At the first
//   contact the origin is on the boundary of the hull, between two neighbouring corners, so that
//   g_i x g_j = 0.
// * If this product is also zero at all times, the origin is at a corner, g_i = 0.
// Each case gives a finite list of roots. At each root the signs of quadratics tell whether the
// hull contains the origin.
#include "exact.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "exact_polynomial.hpp"

namespace tauguard::cloth {
namespace {

using Vector = std::array<Polynomial, 3>;  // of polynomials in time

Polynomial dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Polynomial cross(const Vector& a, const Vector& b, int k) {
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  return a[i] * b[j] - a[j] * b[i];
}

// The corners of the hull, in order around it.
struct Hull {
  std::array<Vector, 4> corner;
  int corners;
  const Vector& after(int i) const { return corner[(i + 1) % corners]; }
  // Component k of corner(i) x corner(i + 1). The sign says on which side the origin is.
  const Polynomial& side(int i, int k) const {
    auto& known = sides[i][k];
    if (!known) known = cross(corner[i], after(i), k);
    return *known;
  }
  mutable std::array<std::array<std::optional<Polynomial>, 3>, 4> sides{};
};

// The motion of vertex a relative to vertex b.
Vector motion(const Ends& x, std::int32_t a, std::int32_t b) {
  Vector m;
  for (int k = 0; k < 3; ++k) {
    const Dyadic start = Dyadic(x.at(false, a)[k]) - Dyadic(x.at(false, b)[k]);
    const Dyadic end = Dyadic(x.at(true, a)[k]) - Dyadic(x.at(true, b)[k]);
    m[k] = trimmed({start, end - start});
  }
  return m;
}

Hull hull_of(bool vf, const Ends& x, const std::int32_t* row) {
  const auto g = [&](int i, int j) { return motion(x, row[i], row[j]); };
  if (vf) return {{g(0, 1), g(0, 2), g(0, 3)}, 3, {}};
  return {{g(2, 0), g(3, 0), g(3, 1), g(2, 1)}, 4, {}};
}

// Whether the origin is on the segment from a to b at time t.
bool between(const Root& t, const Vector& a, const Vector& b) {
  for (int k = 0; k < 3; ++k)
    if (sign_at(t, cross(a, b, k)) != 0) return false;
  return sign_at(t, dot(a, b)) <= 0;
}

// Whether the hull contains the origin at a time t when both are in one plane.
bool contains_origin(const Hull& hull, const Root& t) {
  // If the projection along axis k has an area, the origin must be on the same side of all edges.
  for (int k = 0; k < 3; ++k) {
    Polynomial area;
    for (int i = 0; i < hull.corners; ++i) area = area + hull.side(i, k);
    const int side = sign_at(t, area);
    if (side == 0) continue;
    for (int i = 0; i < hull.corners; ++i)
      if (sign_at(t, hull.side(i, k)) == -side) return false;
    return true;
  }
  for (int i = 0; i < hull.corners; ++i)
    for (int j = i + 1; j < hull.corners; ++j)
      if (between(t, hull.corner[i], hull.corner[j])) return true;
  return false;
}

// Adds the roots of the first component that is not the zero polynomial; false if there is none.
bool add_roots(const Vector& v, std::vector<Root>& times) {
  for (const auto& component : v) {
    if (component.empty()) continue;
    for (auto& root : roots_of(component)) times.push_back(std::move(root));
    return true;
  }
  return false;
}

const Root start{Dyadic(), Dyadic(), {}};

std::vector<Root> candidate_times(const Hull& hull) {
  const auto& g = hull.corner;
  const Polynomial cubic = dot(g[0], {hull.side(1, 0), hull.side(1, 1), hull.side(1, 2)});
  if (!cubic.empty()) return roots_of(cubic);
  std::vector<Root> times{start};
  if (contains_origin(hull, start)) return times;
  for (int i = 0; i < hull.corners; ++i)
    if (!add_roots({hull.side(i, 0), hull.side(i, 1), hull.side(i, 2)}, times)) {
      add_roots(g[i], times);
      add_roots(hull.after(i), times);
    }
  std::sort(times.begin(), times.end(), [](const Root& a, const Root& b) { return a.lo < b.lo; });
  return times;
}

}  // namespace

double exact_contact(bool vf, const Ends& x, const std::int32_t* row) {
  const Hull hull = hull_of(vf, x, row);
  for (const auto& t : candidate_times(hull))
    if (contains_origin(hull, t)) return t.floor();
  return std::numeric_limits<double>::infinity();
}

}  // namespace tauguard::cloth
