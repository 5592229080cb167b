// First contact of two moving meshes, and of rows of moving convex bodies.
#pragma once

#include "mesh_query.hpp"
#include "tauguard/rigid/first_contact.hpp"

namespace tauguard::rigid {

// toi (inf: none), a common point and the normal from a to b at that time (NaN where undefined).
struct FirstTouch {
  double toi, point[3], normal[3];
};

FirstTouch bodies_impact(const Bodies& a, const Bodies& b, std::size_t row,
                         const RigidMotion& motion_a, const RigidMotion& motion_b);

// `faces` gets the triangles that touch first, {-1, -1} where none do. Surfaces count, not what
// they enclose.
FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b, FacePair* faces);

}  // namespace tauguard::rigid
