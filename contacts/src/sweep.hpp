// Contacts of the pairs of a scene in one step: a filter by swept boxes, then times of impact.
#pragma once

#include <cstdint>
#include <vector>

#include "tauguard/geometry/aabb.hpp"
#include "tauguard/rigid/first_contact.hpp"

namespace tauguard::contacts {

using namespace rigid;  // the convex kernel
using geometry::Aabb;

// Two geoms. Contacts are listed if the surfaces are within the distance `reach`.
struct GeomPair {
  std::int32_t a, b;
  double reach;
};

struct Row {
  std::int32_t first, second, feature;
  double t, distance;
  Vec3 point, normal;
};

// A box that contains a moving shape during the whole step; `motion` is the motion of its body.
Aabb swept(SupportShape mover, const RigidMotion& motion);

// Poses of the bodies at both ends of a step, (nbody, 3) and (nbody, 9). `turn`, if given, is an
// estimate of the bodies' rotation vectors (nbody, 3) [rad], for the number of full turns.
struct Poses {
  const double *xpos_t0, *xmat_t0, *xpos_t1, *xmat_t1;
  const double* turn = nullptr;
};

struct Counts {
  std::int64_t moved = 0, reused = 0, candidates = 0;
};

class Geoms {
 public:
  void add(Shape shape, int body, const LocalFrame& in_body);
  std::size_t size() const { return shapes_.size(); }

  // Updates motions and swept boxes, except of bodies at rest in this and the last step.
  void update(const Poses& poses);
  bool still(int geom) const { return still_[body_[geom]]; }  // at rest in this step
  bool as_before(int geom) const {
    return same_[body_[geom]];
  }  // at rest in this and the last step
  const Aabb& box(int geom) const { return boxes_[geom]; }
  const Shape& shape(int geom) const { return shapes_[geom]; }
  const LocalFrame& in_body(int geom) const { return in_body_[geom]; }
  const RigidMotion& motion(int geom) const { return motions_[body_[geom]]; }
  SupportShape mover(int geom, const Vec3& origin) const;
  std::int64_t moved() const { return moved_; }

 private:
  std::vector<Shape> shapes_;
  std::vector<LocalFrame> in_body_;
  std::vector<int> body_;
  std::vector<int> bodies_;           // bodies with geoms
  std::vector<RigidMotion> motions_;  // indexed by body, like the lists below
  std::vector<char> still_, same_, seen_;
  std::vector<Aabb> boxes_;
  std::vector<double> last_;  // 24 numbers for each body: both poses of the last step
  std::int64_t moved_ = 0;
};

class RigidPairs {
 public:
  explicit RigidPairs(std::vector<GeomPair> pairs)
      : pairs_(std::move(pairs)), cache_(pairs_.size()) {}
  Counts find(Geoms& geoms, const Poses& poses, std::vector<Row>* rows);

 private:
  struct Cached {
    bool known = false, hit = false;
    Row row{};
  };
  std::vector<GeomPair> pairs_;
  std::vector<Cached> cache_;
};

// A geom against which the simplices of a flex are tested. `skip` marks simplices attached to the
// geom's body, which are left out.
struct FlexPair {
  std::int32_t geom;
  double reach;
  const std::uint8_t* skip;  // one per simplex
};

Counts find_flex(Geoms& geoms, const Poses& poses, const double* x_t0, const double* x_t1,
                 const std::int32_t* elements, std::size_t count, int corners, double radius,
                 const std::vector<FlexPair>& pairs, std::vector<Row>* rows);

// Whether two simplices of linearly moving vertices come within `distance` of each other.
bool simplices_touch(const double* x_t0, const double* x_t1, const std::int32_t* a,
                     const std::int32_t* b, int corners, double distance, Touch* touch);

}  // namespace tauguard::contacts
