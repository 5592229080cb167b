// First contact of two moving meshes.
#pragma once

#include "first_touch.hpp"
#include "mesh_query.hpp"

namespace tauguard::rigid {

// `faces` receives the triangles that touch first, or {-1, -1}. Meshes are surfaces without inside.
FirstTouch meshes_impact(const Mesh& a, const Mesh& b, const RigidMotion& motion_a,
                         const RigidMotion& motion_b, FacePair* faces);

}  // namespace tauguard::rigid
