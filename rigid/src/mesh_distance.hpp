// The distance of the surfaces of two meshes.
#pragma once

#include "mesh_query.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::rigid {

// In the frame of a. The distance is 0 if and only if the surfaces share a point; then `point_a`
// and `point_b` are a common point and the normal is that of the contact of both triangles.
struct MeshGap {
  double distance;
  geometry::Vec3 point_a, point_b, normal;  // the normal points from a to b
  FacePair faces;                           // rows of the faces
};
MeshGap mesh_distance(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch);

}  // namespace tauguard::rigid
