// For how long boxes and triangles of two meshes are certainly apart in a piece of the step
// (mesh_pieces.hpp). Positions are in the frame of one of the meshes. A point of the other mesh
// moves along the chord of its path, with an error of at most the sagitta of the path.
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
  double sagitta;   // bound on every path's distance from its chord, m
  double turn;      // half of the rotation angle, rad
  double rounding;  // error of positions by rounding and by rotations that are not orthonormal, m
  float float_rounding;  // the same error in float, m
};

// A box whose centre moves by `move`.
struct MovingObb {
  FloatObb box;
  float move[3], pad;
};
MovingObb moving(const FloatObb& box, const Chord& chord);

// Sets bit s if child s may meet the box before the fraction `leave` of the chord. `enter`
// receives, for each child, the fraction up to which it is certainly apart from the box.
unsigned swept_mask(const ObbNode& node, const MovingObb& moving, float leave, float* enter);

// The fraction of the chord up to which two triangles are certainly apart; inf for the whole chord.
// `b0`, `b1`: the second triangle at the ends of the chord, in the frame of `a`.
double certainly_apart(const Vec3* a, const Vec3* b0, const Vec3* b1, double pad);

// The children of a node as oriented boxes, for any kind of tree; they may be in `scratch`.
const ObbNode& oriented(const Mesh& mesh, std::int32_t node, ObbNode& scratch);
FloatObb oriented_box(const Mesh& mesh, const Slot& slot);

}  // namespace tauguard::rigid
