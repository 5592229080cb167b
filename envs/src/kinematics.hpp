// Kinematics of a scene's arms from MuJoCo's arrays, and sums over their joints that the
// environments need: gravity, the torque of a wrench, and the joint step of a Cartesian increment.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "physics.hpp"
#include "tauguard/geometry/fields.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::envs {

using geometry::load;
using geometry::Vec3;

// The tool of an arm: a site, or the origin of a body if `site` is -1. `first`: the arm's first
// joint.
struct Tool {
  int site = -1, body = -1, first = 0;
  TAUGUARD_FIELDS(site, body, first)
};

// Joint i moves link i; the joints of one arm are consecutive, base to tip.
struct Link {
  int joint = -1, body = -1;  // MuJoCo ids
  int first = 0;              // index of the first joint of the same arm
  bool slide = false;         // prismatic
  double mass = 0;            // nominal [kg]
  Vec3 com;                   // nominal, in the link's frame [m]
  TAUGUARD_FIELDS(joint, body, first, slide, mass, com)
};

struct Kinematics {
  const Physics* physics = nullptr;
  std::vector<Link> links;
  Vec3 gravity;  // [m/s^2]
  TAUGUARD_FIELDS(links, gravity)

  std::size_t size() const { return links.size(); }
  Vec3 axis(std::size_t i) const { return load(physics->axis(links[i].joint)); }
  Vec3 anchor(std::size_t i) const { return load(physics->anchor(links[i].joint)); }
  // Velocity of point p, which joint i moves, per unit of the joint's velocity.
  Vec3 lever(std::size_t i, Vec3 p) const {
    return links[i].slide ? axis(i) : cross(axis(i), p - anchor(i));
  }

  // Velocity of point p of a link at joint velocities qd.
  Vec3 velocity(std::size_t link, Vec3 p, const double* qd) const {
    Vec3 v;
    for (std::size_t i = begin(link); i <= link; ++i) v = v + qd[i] * lever(i, p);
    return v;
  }

  Vec3 tool(const Tool& t) const {
    return load(t.site >= 0 ? physics->site_position(t.site) : physics->position(t.body));
  }

  // Centre of mass of nominal link i.
  Vec3 centre(std::size_t i) const {
    const double* m = physics->rotation(links[i].body);
    const Vec3 c = links[i].com;
    return load(physics->position(links[i].body)) + Vec3{m[0] * c.x + m[1] * c.y + m[2] * c.z,
                                                         m[3] * c.x + m[4] * c.y + m[5] * c.z,
                                                         m[6] * c.x + m[7] * c.y + m[8] * c.z};
  }

  // Torques that hold the nominal links against gravity [N m], one per joint.
  void hold(double* tau) const {
    std::fill(tau, tau + size(), 0.0);
    for (std::size_t link = 0; link < size(); ++link) {
      const Vec3 c = centre(link);
      for (std::size_t i = begin(link); i <= link; ++i)
        tau[i] -= links[link].mass * dot(lever(i, c), gravity);
    }
  }

  // Adds J^T of a wrench on a link: force at p and torque, world frame.
  void push(std::size_t link, Vec3 p, Vec3 force, Vec3 torque, double* tau) const {
    for (std::size_t i = begin(link); i <= link; ++i)
      tau[i] += dot(lever(i, p), force) + (links[i].slide ? 0.0 : dot(axis(i), torque));
  }

  // Joint step dq of joints [begin, end) that moves the tool point by dx (3 m, 3 rad about world
  // axes): damped least squares J^T (J J^T + damping^2 I)^-1 dx.
  void resolve(std::size_t begin, std::size_t end, Vec3 tool, const double* dx, double damping,
               double* dq) const {
    std::array<double, 36> a{};
    std::vector<std::array<double, 6>> columns;
    for (std::size_t i = begin; i < end; ++i) {
      const Vec3 v = lever(i, tool), w = links[i].slide ? Vec3{} : axis(i);
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
  std::size_t begin(std::size_t link) const { return static_cast<std::size_t>(links[link].first); }

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
