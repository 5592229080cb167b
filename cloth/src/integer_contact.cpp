// First contact in integers, by the steps of exact.cpp, which explains the terms.
#include "integer_contact.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "bernstein.hpp"
#include "binary.hpp"

namespace tauguard::cloth {
namespace {

using Vector = std::array<Bernstein<1>, 3>;

// Coordinate k of four vertices at the start and the end of the step, out[vertex][end], as integers
// in a common unit; false if they span more than `coordinate_bits`.
bool on_axis(const Ends& x, const std::int32_t* row, int k, FixedInt<2> (*out)[2]) {
  double values[8];
  for (int v = 0; v < 4; ++v)
    for (int e = 0; e < 2; ++e) values[2 * v + e] = x.at(e, row[v])[k];
  return as_integers(values, 8, out[0]);
}

Bernstein<2> cross(const Vector& a, const Vector& b, int k) {
  const int i = (k + 1) % 3, j = (k + 2) % 3;
  return a[i] * b[j] - a[j] * b[i];
}

class Hull {
 public:
  // x: coordinates as [axis][vertex][end]. wire: a degenerate face (a, b, b).
  Hull(bool vf, bool wire, const FixedInt<2> (&x)[3][4][2]) : corners_(wire ? 2 : vf ? 3 : 4) {
    constexpr int of_vf[][2] = {{0, 1}, {0, 2}, {0, 3}},
                  of_ee[][2] = {{2, 0}, {3, 0}, {3, 1}, {2, 1}};
    for (int i = 0; i < corners_; ++i) {
      const int* pair = vf ? of_vf[i] : of_ee[i];
      for (int k = 0; k < 3; ++k)
        for (int e = 0; e < 2; ++e) corner_[i][k].c[e] = x[k][pair[0]][e] - x[k][pair[1]][e];
    }
  }

  double first_contact() {
    const Bernstein<3> cubic =
        corner_[0][0] * side(1, 0) + corner_[0][1] * side(1, 1) + corner_[0][2] * side(1, 2);
    if (cubic.zero()) return first_contact_in_plane();
    const auto roots = roots_of(cubic);
    return first_of(roots.all.data(), roots.count, roots.complete);
  }

 private:
  static constexpr double never = std::numeric_limits<double>::infinity(),
                          silent = std::numeric_limits<double>::quiet_NaN();

  const Vector& after(int i) const { return corner_[(i + 1) % corners_]; }
  const Bernstein<2>& side(int i, int k) {
    auto& known = sides_[i][k];
    if (!known) known = cross(corner_[i], after(i), k);
    return *known;
  }

  // The sign of q at t. If it is unknown, sets open_ and returns an invalid sign.
  template <class Time>
  int sign(const Bernstein<2>& q, const Time& t) {
    const int s = sign_at(q, t);
    open_ = open_ || s == unknown_sign;
    return s;
  }

  template <class Time>
  bool between(const Time& t, const Vector& a, const Vector& b) {
    for (int k = 0; k < 3; ++k)
      if (sign(cross(a, b, k), t) != 0) return false;
    return sign(a[0] * b[0], t) <= 0 && sign(a[1] * b[1], t) <= 0 && sign(a[2] * b[2], t) <= 0;
  }

  template <class Time>
  bool contains_origin(const Time& t) {
    for (int k = 0; k < 3; ++k) {
      Bernstein<2> area = side(0, k);
      for (int i = 1; i < corners_; ++i) area = area + side(i, k);
      const int s = sign(area, t);
      if (s == 0) continue;
      for (int i = 0; i < corners_; ++i)
        if (sign(side(i, k), t) == -s) return false;
      return true;
    }
    for (int i = 0; i < corners_; ++i)
      for (int j = i + 1; j < corners_; ++j)
        if (between(t, corner_[i], corner_[j])) return true;
    return false;
  }

  template <class Time>
  double first_of(const Time* times, int count, bool complete) {
    for (int i = 0; i < count; ++i) {
      const bool contact = contains_origin(times[i]);
      if (open_) return silent;
      if (contact && (complete || times[i].lo == 0))
        return static_cast<double>(times[i].lo) * 0x1p-52;
    }
    return complete ? never : silent;
  }

  double first_contact_in_plane() {
    const BernsteinRoot<2> start{0, 0};
    const bool touching = contains_origin(start);
    if (open_ || touching) return touching && !open_ ? 0 : silent;
    std::array<BernsteinRoot<2>, 16> times;
    int count = 0;
    bool complete = true;
    for (int i = 0; i < corners_; ++i) {
      int k = 0;
      while (k < 3 && side(i, k).zero()) ++k;
      const Bernstein<2>* moving[2] = {k < 3 ? &side(i, k) : raised(i),
                                       k < 3 ? nullptr : raised(i + 1)};
      for (const Bernstein<2>* side : moving) {
        if (!side) continue;
        const auto roots = roots_of(*side);
        std::copy_n(roots.all.begin(), roots.count, times.begin() + count);
        count += roots.count;
        complete = complete && roots.complete;
      }
    }
    std::sort(times.begin(), times.begin() + count,
              [](const auto& a, const auto& b) { return a.lo < b.lo; });
    return first_of(times.data(), count, complete);
  }

  // The first coordinate of corner i that is not always zero, raised to degree 2; null if none is.
  const Bernstein<2>* raised(int i) {
    i %= corners_;
    for (const Bernstein<1>& x : corner_[i]) {
      if (x.zero()) continue;
      const FixedInt<4> a(x.c[0]), b(x.c[1]);
      raised_[i].c = {a, a + b, b};
      return &raised_[i];
    }
    return nullptr;
  }

  int corners_;
  std::array<Bernstein<2>, 4> raised_;
  std::array<Vector, 4> corner_;
  std::array<std::array<std::optional<Bernstein<2>>, 3>, 4> sides_{};
  bool open_ = false;
};

}  // namespace

double integer_contact(bool vf, const Ends& ends, const std::int32_t* row) {
  FixedInt<2> x[3][4][2];
  for (int k = 0; k < 3; ++k)
    if (!on_axis(ends, row, k, x[k])) return std::numeric_limits<double>::quiet_NaN();
  return Hull(vf, vf && row[2] == row[3], x).first_contact();
}

}  // namespace tauguard::cloth
