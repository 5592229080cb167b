// One mesh and one convex body, which may be grown by a ball: overlap, distance, first contact. The
// surface of the mesh counts, not what it encloses; the body is solid.
#pragma once

#include "first_touch.hpp"
#include "mesh_pieces.hpp"
#include "signed_distance.hpp"

namespace tauguard::rigid {

// A row of a batch in its own frame, and an oriented box around it, seen from the extent's centre.
class RoundedBody {
 public:
  RoundedBody(const Bodies& bodies, std::size_t row, double rounding);
  RoundedBody(const RoundedBody&) = delete;
  RoundedBody& operator=(const RoundedBody&) = delete;

  Bodies bodies;  // that row alone
  double rounding;
  Points<double> points;
  Extent extent;
  FloatObb box;

 private:
  std::array<Vec3, 3> axes() const;
  std::int64_t offsets_[2];
};

// Some triangle that shares a point with the body (touching counts), a row of the faces; -1: none.
std::int32_t first_overlap(const Mesh& mesh, const RoundedBody& body);

// The least signed distance of a triangle of the mesh (a) to the body (b), and the first triangle
// that has it. If they meet, it is that of the triangle deepest in the body.
struct FaceDistance {
  SignedDistance at;
  std::int32_t face;
};
FaceDistance nearest_face(const Mesh& mesh, const RoundedBody& body);

// `face` gets the triangle that is touched first, -1 where none is.
FirstTouch mesh_body_impact(const Mesh& mesh, const RoundedBody& body, const RigidMotion& of_mesh,
                            const RigidMotion& of_body, std::int32_t* face);

}  // namespace tauguard::rigid
