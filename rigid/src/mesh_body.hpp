// Overlap, distance and first contact of one mesh and one convex body, which may be grown by a
// ball. The mesh is its surface, not the volume inside; the body is solid.
#pragma once

#include "first_touch.hpp"
#include "mesh_pieces.hpp"
#include "signed_distance.hpp"

namespace tauguard::rigid {

// A row of a batch in its own frame, and an oriented box around it, relative to the extent's
// centre.
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

// A triangle (row of the faces) that shares a point with the body; touching counts. -1 if there is
// none.
std::int32_t first_overlap(const Mesh& mesh, const RoundedBody& body);

// The least signed distance of a triangle of the mesh (a) to the body (b), and the first triangle
// with that distance. If mesh and body meet, this is the triangle deepest in the body.
struct FaceDistance {
  SignedDistance at;
  std::int32_t face;
};
FaceDistance nearest_face(const Mesh& mesh, const RoundedBody& body);

// `face` receives the triangle that is touched first, or -1.
FirstTouch mesh_body_impact(const Mesh& mesh, const RoundedBody& body, const RigidMotion& of_mesh,
                            const RigidMotion& of_body, std::int32_t* face);

}  // namespace tauguard::rigid
