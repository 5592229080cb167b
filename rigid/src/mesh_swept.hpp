// Tells how long boxes and triangles of two meshes are certainly apart during a piece of the step
// so short that they hardly turn. Positions are relative to one of the meshes. A point of the other
// moves on its chord, with an error of at most the sagitta of its path.
#pragma once

#include "mesh_query.hpp"
#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

// x -> r x + t
struct Place {
  Vec3 r[3], t;
  Vec3 operator()(const Vec3& x) const {
    return Vec3{dot(r[0], x), dot(r[1], x), dot(r[2], x)} + t;
  }
  Vec3 turn_back(const Vec3& x) const { return x[0] * r[0] + (x[1] * r[1] + x[2] * r[2]); }
};
Place place_at(const RigidMotion& m, double t);

// One mesh in the other's frame at the start, the middle and the end of a piece of the step.
struct Chord {
  Place start, middle, end;
  double sagitta;   // of any point's path, m
  double turn;      // half of the rotation angle, rad
  double rounding;  // of positions in double, and of rotations that are only nearly orthonormal, m
  float float_rounding;  // the same in float
};

// A box whose centre moves by `move`.
struct MovingObb {
  FloatObb box;
  float move[3], pad;
};
MovingObb moving(const FloatObb& box, const Chord& chord);

// Sets bit s if child s may meet the box before the fraction `leave` of the chord. `enter` receives
// the fraction up to which they are certainly apart.
unsigned swept_mask(const ObbNode& node, const MovingObb& moving, float leave, float* enter);

// The fraction of the chord up to which two triangles are certainly apart; inf for all of it. `b0`,
// `b1`: the other triangle at the chord's ends, in the frame of `a`.
double certainly_apart(const Vec3* a, const Vec3* b0, const Vec3* b1, double pad);

// The children of a node as oriented boxes, for every kind of volume of the mesh. The answer may be
// stored in `scratch`.
const ObbNode& oriented(const Mesh& mesh, std::int32_t node, ObbNode& scratch);
FloatObb oriented_box(const Mesh& mesh, const Slot& slot);

}  // namespace tauguard::rigid
