// Contact is the origin in the hull of the features' differences, as in exact.cpp, at one time. In
// most that touch a coordinate is the same in all four vertices, and two dimensions are left, in
// which products of doubles tell; the others are decided in integers.
#include "start_contact.hpp"

#include <array>
#include <cmath>

#include "binary.hpp"

namespace tauguard::cloth {
namespace {

using geometry::FixedInt;

// The hull's corners in order around it: the first vertex as seen from the second.
constexpr int of_vf[][2] = {{0, 1}, {0, 2}, {0, 3}}, of_ee[][2] = {{2, 0}, {3, 0}, {3, 1}, {2, 1}};
constexpr int unknown_sign = 2;

// a - b, and whether that is exact (Knuth's sum and its error).
bool exact_difference(double a, double b, double& d) {
  d = a - b;
  const double z = d - a;
  return (a - (d - z)) - (b + z) == 0;
}

// The sign of a x b. Rounding keeps the order of two products; where they round to the same, their
// errors tell, which are exact for products in this range.
int turn(const double* a, const double* b) {
  const double left = a[0] * b[1], right = a[1] * b[0];
  if (left != right) return left > right ? 1 : -1;
  if (left == 0 && (a[0] == 0 || b[1] == 0) && (a[1] == 0 || b[0] == 0)) return 0;
  if (!(std::fabs(left) > 0x1p-900 && std::fabs(left) < 0x1p1000)) return unknown_sign;
  const double e = std::fma(a[0], b[1], -left), f = std::fma(a[1], b[0], -right);
  return (e > f) - (e < f);
}

bool opposite(double a, double b) { return !((a > 0 && b > 0) || (a < 0 && b < 0)); }

// Where one coordinate is the same in all: the others, i and j, tell.
AtStart in_plane(bool vf, const double* const* p, int i, int j) {
  const int corners = vf ? 3 : 4;
  double g[4][2];
  for (int c = 0; c < corners; ++c) {
    const int* pair = vf ? of_vf[c] : of_ee[c];
    if (!exact_difference(p[pair[0]][i], p[pair[1]][i], g[c][0]) ||
        !exact_difference(p[pair[0]][j], p[pair[1]][j], g[c][1]))
      return AtStart::unknown;
  }
  bool left = false, right = false;
  for (int c = 0; c < corners; ++c) {
    const int side = turn(g[c], g[(c + 1) % corners]);
    if (side == unknown_sign) return AtStart::unknown;
    left = left || side > 0;
    right = right || side < 0;
  }
  if (left || right) return left && right ? AtStart::apart : AtStart::touching;
  // All corners on one line through the origin: the way around them covers their hull.
  for (int c = 0; c < corners; ++c) {
    const double *a = g[c], *b = g[(c + 1) % corners];
    if (opposite(a[0], b[0]) && opposite(a[1], b[1])) return AtStart::touching;
  }
  return AtStart::apart;
}

class Hull {
 public:
  // Coordinates as [axis][vertex].
  Hull(bool vf, const FixedInt<2> (&x)[3][4]) : corners_(vf ? 3 : 4) {
    for (int c = 0; c < corners_; ++c) {
      const int* pair = vf ? of_vf[c] : of_ee[c];
      for (int k = 0; k < 3; ++k) corner_[c][k] = x[k][pair[0]] - x[k][pair[1]];
    }
  }

  bool contains_origin() const {
    const auto height = corner_[0][0] * cross(1, 2, 0) + corner_[0][1] * cross(1, 2, 1) +
                        corner_[0][2] * cross(1, 2, 2);
    if (height.sign() != 0) return false;
    for (int k = 0; k < 3; ++k) {
      bool left = false, right = false;
      for (int c = 0; c < corners_; ++c) {
        const int side = cross(c, (c + 1) % corners_, k).sign();
        left = left || side > 0;
        right = right || side < 0;
      }
      if (left && right) return false;
      if (left || right) return true;
    }
    for (int c = 0; c < corners_; ++c)
      for (int d = c + 1; d < corners_; ++d)
        if (between(c, d)) return true;
    return false;
  }

 private:
  FixedInt<4> cross(int c, int d, int k) const {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    return corner_[c][i] * corner_[d][j] - corner_[c][j] * corner_[d][i];
  }
  bool between(int c, int d) const {
    for (int k = 0; k < 3; ++k)
      if (cross(c, d, k).sign() != 0 || corner_[c][k].sign() * corner_[d][k].sign() > 0)
        return false;
    return true;
  }

  int corners_;
  std::array<std::array<FixedInt<2>, 3>, 4> corner_;
};

}  // namespace

AtStart at_start(bool vf, const Ends& x, const std::int32_t* row) {
  const double* p[4];
  for (int v = 0; v < 4; ++v) p[v] = x.at(false, row[v]);
  for (int k = 0; k < 3; ++k) {
    if (!(p[0][k] == p[1][k] && p[0][k] == p[2][k] && p[0][k] == p[3][k])) continue;
    const AtStart found = in_plane(vf, p, (k + 1) % 3, (k + 2) % 3);
    if (found != AtStart::unknown) return found;
  }
  FixedInt<2> whole[3][4];
  for (int k = 0; k < 3; ++k) {
    const double on_axis[4] = {p[0][k], p[1][k], p[2][k], p[3][k]};
    if (!as_integers(on_axis, 4, whole[k])) return AtStart::unknown;
  }
  return Hull(vf, whole).contains_origin() ? AtStart::touching : AtStart::apart;
}

}  // namespace tauguard::cloth
