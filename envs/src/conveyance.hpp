// Bodies with a prescribed motion: along a path, or as the surface of a belt.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "physics.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::envs {

using geometry::Vec3;

// A body that follows a path: rows of time [s] and position [m]. The path is repeated.
struct Carried {
  int mocap = -1;
  std::vector<std::array<double, 4>> path;

  Vec3 at(double t) const {
    const double period = path.back()[0];
    t -= period * std::floor(t / period);
    std::size_t k = 1;
    while (k + 1 < path.size() && path[k][0] <= t) ++k;
    const auto &a = path[k - 1], &b = path[k];
    const double s = (t - a[0]) / (b[0] - a[0]);
    return {a[1] + s * (b[1] - a[1]), a[2] + s * (b[2] - a[2]), a[3] + s * (b[3] - a[3])};
  }

  void follow(const Physics& physics, double t) const {
    const Vec3 p = at(t);
    double* place = physics.mocap_position(mocap);
    place[0] = p.x, place[1] = p.y, place[2] = p.z;
  }
};

// The surface of a conveyor: a slide joint with the velocity `speed` [m/s] that stays at position
// 0.
struct Belt {
  int qpos = -1, dof = -1;
  double speed = 0;

  void run(const Physics& physics) const { physics.qpos()[qpos] = 0, physics.qvel()[dof] = speed; }
};

}  // namespace tauguard::envs
