// The features touch at a given time if the hull of their differences contains the origin
// (exact.cpp). In most pairs that touch, one coordinate is the same in all four vertices. They are
// decided in two dimensions by signs of differences or a filtered determinant, others in integers.
#include "start_contact.hpp"

#include <array>
#include <cmath>

#include "binary.hpp"

#include "tauguard/geometry/signs.hpp"

namespace tauguard::cloth {
namespace {

using geometry::FixedInt;

// The corners in order around the hull; a corner is the first vertex relative to the second.
constexpr int of_vf[][2] = {{0, 1}, {0, 2}, {0, 3}}, of_ee[][2] = {{2, 0}, {3, 0}, {3, 1}, {2, 1}};
// Neighbouring corners have a common vertex (the first of a row). Their cross product is that of
// the two other vertices relative to the common one.
constexpr int sides_of_vf[][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}};
constexpr int sides_of_ee[][3] = {{0, 2, 3}, {3, 0, 1}, {1, 3, 2}, {2, 1, 0}};

bool opposite(double a, double b) { return !((a > 0 && b > 0) || (a < 0 && b < 0)); }

// Decides a query whose vertices differ only in the coordinates i and j, by the sides of the hull's
// edges on which the origin is. With u = 2^-53 the relative error of a product of two differences
// is 3 u, and of the difference of two products 4 u = 2^-51. Faces on top of each other often share
// lines along the axes, where differences are exactly zero. Branches in the loop would be
// mispredicted.
template <bool vf>
AtStart in_plane(const double* const* p, int i, int j) {
  constexpr int corners = vf ? 3 : 4;
  bool left = false, right = false;
  unsigned unsure = 0;
  for (int c = 0; c < corners; ++c) {
    const int* side = vf ? sides_of_vf[c] : sides_of_ee[c];
    const double *o = p[side[0]], *a = p[side[1]], *b = p[side[2]];
    const double ax = a[i] - o[i], ay = a[j] - o[j], bx = b[i] - o[i], by = b[j] - o[j];
    const double x = ax * by, y = ay * bx, size = std::fabs(x) + std::fabs(y), cross = x - y;
    const bool plus = cross > 0x1p-51 * size, minus = cross < -0x1p-51 * size,
               large = size > 1e-250, on = ((ax == 0) | (by == 0)) & ((ay == 0) | (bx == 0));
    left |= plus & large;
    right |= minus & large;
    unsure |= unsigned(!(on | ((plus | minus) & large))) << c;
  }
  if (left & right) return AtStart::apart;
  for (; unsure; unsure &= unsure - 1) {
    const int c = __builtin_ctz(unsure), *side = vf ? sides_of_vf[c] : sides_of_ee[c];
    double flat[3][2];
    for (int v = 0; v < 3; ++v) flat[v][0] = p[side[v]][i], flat[v][1] = p[side[v]][j];
    const int sign = geometry::orient2d(flat[0], flat[1], flat[2]);
    left |= sign > 0;
    right |= sign < 0;
  }
  if (left & right) return AtStart::apart;
  if (left | right) return AtStart::touching;
  // All corners are on one line through the origin. Segments between neighbours cover the hull.
  for (int c = 0; c < corners; ++c) {
    const int *a = vf ? of_vf[c] : of_ee[c],
              *b = vf ? of_vf[(c + 1) % corners] : of_ee[(c + 1) % corners];
    const auto on = [&](const int* pair, int k) { return p[pair[0]][k] - p[pair[1]][k]; };
    if (opposite(on(a, i), on(b, i)) && opposite(on(a, j), on(b, j))) return AtStart::touching;
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
    return (vf ? in_plane<true> : in_plane<false>)(p, (k + 1) % 3, (k + 2) % 3);
  }
  FixedInt<2> whole[3][4];
  for (int k = 0; k < 3; ++k) {
    const double on_axis[4] = {p[0][k], p[1][k], p[2][k], p[3][k]};
    if (!as_integers(on_axis, 4, whole[k])) return AtStart::unknown;
  }
  return Hull(vf, whole).contains_origin() ? AtStart::touching : AtStart::apart;
}

}  // namespace tauguard::cloth
