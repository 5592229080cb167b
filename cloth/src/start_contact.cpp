// The features touch at a given time if the hull of their differences contains the origin
// (exact.cpp). Queries whose four vertices have one equal coordinate are decided in two dimensions,
// others in integers. batch.cpp decides most features that touch, so few queries come here.
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

bool opposite(double a, double b) { return !((a > 0 && b > 0) || (a < 0 && b < 0)); }

// Decides a query whose vertices differ only in the coordinates i and j. The features are apart if
// the origin is to the left of one edge of the hull and to the right of another.
template <bool vf>
AtStart in_plane(const double* const* p, int i, int j) {
  constexpr int corners = vf ? 3 : 4;
  bool left = false, right = false;
  for (int c = 0; c < corners; ++c) {
    double flat[3][2];
    for (int v = 0; v < 3; ++v) {
      const double* of = p[sides_of<vf>[c][v]];
      flat[v][0] = of[i];
      flat[v][1] = of[j];
    }
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
