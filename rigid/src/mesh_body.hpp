// Overlap, distance and first contact of a mesh and a convex body, which may be grown by a ball.
// The mesh is a surface without inside; the body is solid.
#pragma once

#include "first_touch.hpp"
#include "mesh_pieces.hpp"
#include "signed_distance.hpp"

namespace tauguard::rigid {

// The body of one row of a batch, and an oriented box around it, relative to `extent.centre`.
class RoundedBody {
 public:
  RoundedBody(const Bodies& bodies, std::size_t row, double rounding);
  RoundedBody(const RoundedBody&) = delete;
  RoundedBody& operator=(const RoundedBody&) = delete;

  Bodies bodies;  // the one row
  double rounding;
  Points<double> points;
  Extent extent;
  FloatObb box;

 private:
  std::array<Vec3, 3> axes() const;
  std::int64_t offsets_[2];
};

// A triangle (row of the faces) that shares a point with the body, or -1. Touching counts.
std::int32_t first_overlap(const Mesh& mesh, const RoundedBody& body);

// The least signed distance of a triangle of the mesh (a) from the body (b), and the first triangle
// with this distance. If mesh and body overlap, it is the triangle that is deepest in the body.
struct FaceDistance {
  SignedDistance at;
  std::int32_t face;
};
FaceDistance nearest_face(const Mesh& mesh, const RoundedBody& body);

// The same for a closed mesh: if a corner of the body (of a curved body: its centre) is inside, by
// more than the deepest triangle, minus its depth and the radius.
FaceDistance deepest_corner(const Mesh& closed, const RoundedBody& body,
                            const FaceDistance& of_surface);

// `face` receives the triangle that the body touches first, or -1.
FirstTouch mesh_body_impact(const Mesh& mesh, const RoundedBody& body, const RigidMotion& of_mesh,
                            const RigidMotion& of_body, std::int32_t* face);

}  // namespace tauguard::rigid
