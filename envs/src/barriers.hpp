// Barriers to a person's motion: the table and objects. MuJoCo has no contacts between them and
// people, so the distance of a person's capsule from the nearest barrier is computed here.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "physics.hpp"
#include "tauguard/geometry/fields.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::envs {

using geometry::load;
using geometry::norm;
using geometry::Vec3;

// Distance [m], negative inside and infinite if no barrier is near; direction away from it.
struct Gap {
  double distance = std::numeric_limits<double>::infinity();
  Vec3 away{0, 0, 1};
};

// A geom and its box in its own frame [m].
struct Barrier {
  int geom = -1;
  Vec3 centre, half;
  TAUGUARD_FIELDS(geom, centre, half)
};

class Barriers {
 public:
  const Physics* physics = nullptr;
  std::vector<Barrier> all;

  // The gap to the nearest barrier if a person's geom were at this pose. Barriers farther than
  // `margin` [m] are left out.
  Gap nearest(int geom, Vec3 centre, const std::array<double, 4>& quat, double margin) const {
    Gap out;
    const double within = physics->bounding_radius(geom) + margin;
    const Physics::Moved there(*physics, geom, centre.data(), quat.data());
    for (const Barrier& b : all) {
      if (outside(b, centre) > within) continue;
      double between[6];
      const double distance = physics->distance(geom, b.geom, margin, between);
      if (distance >= std::min(margin, out.distance)) continue;
      out.distance = distance;
      const Vec3 path = load(between) - load(between + 3);
      const double size = norm(path);
      out.away = size > 1e-9 ? ((distance < 0 ? -1.0 : 1.0) / size) * path : Vec3{0, 0, 1};
    }
    return out;
  }

 private:
  // A lower bound on the distance of a point from a barrier [m].
  double outside(const Barrier& b, Vec3 point) const {
    const Vec3 d = point - load(physics->geom_position(b.geom));
    const double* r = physics->geom_rotation(b.geom);
    Vec3 out;
    for (int k = 0; k < 3; ++k) {
      const double along = r[k] * d.x + r[3 + k] * d.y + r[6 + k] * d.z;
      out[k] = std::max(std::fabs(along - b.centre[k]) - b.half[k], 0.0);
    }
    return norm(out);
  }
};

}  // namespace tauguard::envs
