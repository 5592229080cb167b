// The arms of a scene as MuJoCo's arrays show them, and the few sums over their joints that the
// environments need: gravity, the torque of a wrench, and the joint step of a Cartesian increment.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tauguard/geometry/vec3.hpp"

namespace tauguard::envs {

using geometry::load;
using geometry::Vec3;

// Joint i moves link i; the joints of one arm are consecutive, base to tip.
struct Chain {
  std::vector<int> joint, body;  // MuJoCo ids
  std::vector<int> first;        // index of the first joint of the same arm
  std::vector<int> slide;        // 1: prismatic
  std::vector<double> mass;      // nominal, of the links [kg]
  std::vector<double> com;       // nominal, in the link's frame [m], three a link
  Vec3 gravity;                  // [m/s^2]
  const double *xpos = nullptr, *xmat = nullptr, *xanchor = nullptr, *xaxis = nullptr;

  std::size_t size() const { return joint.size(); }
  Vec3 axis(std::size_t i) const { return load(xaxis + 3 * joint[i]); }
  Vec3 anchor(std::size_t i) const { return load(xanchor + 3 * joint[i]); }
  // How far the point p of a link beyond joint i moves per unit of joint i.
  Vec3 lever(std::size_t i, Vec3 p) const {
    return slide[i] ? axis(i) : cross(axis(i), p - anchor(i));
  }

  Vec3 centre(std::size_t i) const {
    const double* m = xmat + 9 * body[i];
    const double* c = com.data() + 3 * i;
    return load(xpos + 3 * body[i]) + Vec3{m[0] * c[0] + m[1] * c[1] + m[2] * c[2],
                                           m[3] * c[0] + m[4] * c[1] + m[5] * c[2],
                                           m[6] * c[0] + m[7] * c[1] + m[8] * c[2]};
  }

  // Torques that hold the nominal links against gravity [N m], one a joint.
  void hold(double* tau) const {
    std::fill(tau, tau + size(), 0.0);
    for (std::size_t link = 0; link < size(); ++link) {
      const Vec3 c = centre(link);
      for (std::size_t i = static_cast<std::size_t>(first[link]); i <= link; ++i)
        tau[i] -= mass[link] * dot(lever(i, c), gravity);
    }
  }

  // Adds J^T of a wrench on a link: force at p and torque, world frame.
  void push(std::size_t link, Vec3 p, Vec3 force, Vec3 torque, double* tau) const {
    for (std::size_t i = static_cast<std::size_t>(first[link]); i <= link; ++i)
      tau[i] += dot(lever(i, p), force) + (slide[i] ? 0.0 : dot(axis(i), torque));
  }

  // Joint step dq of joints [begin, end) that moves the tool point by dx (3 m, 3 rad about world
  // axes): damped least squares J^T (J J^T + damping^2 I)^-1 dx.
  void resolve(std::size_t begin, std::size_t end, Vec3 tool, const double* dx, double damping,
               double* dq) const {
    std::array<double, 36> a{};
    std::vector<std::array<double, 6>> columns;
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3 v = lever(i, tool), w = slide[i] ? Vec3{} : axis(i);
      columns.push_back({v.x, v.y, v.z, w.x, w.y, w.z});
      for (int r = 0; r < 6; ++r)
        for (int c = 0; c < 6; ++c) a[6 * r + c] += columns.back()[r] * columns.back()[c];
    }
    for (int r = 0; r < 6; ++r) a[7 * r] += damping * damping;
    std::array<double, 6> y;
    std::copy(dx, dx + 6, y.begin());
    solve(a, y);
    for (std::size_t i = begin; i < end; ++i) {
      double sum = 0.0;
      for (int r = 0; r < 6; ++r) sum += columns[i - begin][r] * y[r];
      dq[i] = sum;
    }
  }

 private:
  // Cholesky; the matrix is positive definite because of its damping.
  static void solve(std::array<double, 36>& a, std::array<double, 6>& y) {
    for (int c = 0; c < 6; ++c) {
      for (int k = 0; k < c; ++k) a[7 * c] -= a[6 * c + k] * a[6 * c + k];
      a[7 * c] = std::sqrt(a[7 * c]);
      for (int r = c + 1; r < 6; ++r) {
        for (int k = 0; k < c; ++k) a[6 * r + c] -= a[6 * r + k] * a[6 * c + k];
        a[6 * r + c] /= a[7 * c];
      }
    }
    for (int r = 0; r < 6; ++r) {
      for (int k = 0; k < r; ++k) y[r] -= a[6 * r + k] * y[k];
      y[r] /= a[7 * r];
    }
    for (int r = 5; r >= 0; --r) {
      for (int k = r + 1; k < 6; ++k) y[r] -= a[6 * k + r] * y[k];
      y[r] /= a[7 * r];
    }
  }
};

}  // namespace tauguard::envs
