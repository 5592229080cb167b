// First contact of two moving meshes.
#pragma once

#include "first_touch.hpp"
#include "mesh_query.hpp"

namespace tauguard::rigid {

// `faces` gets the triangles that touch first, {-1, -1} where none do. Surfaces count, not what
// they enclose.
FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b, FacePair* faces);

}  // namespace tauguard::rigid
