// Smooth pieces of support functions, and Newton's method for the direction along which two shapes
// are furthest apart (or overlap least).
//
// A support function is the maximum of smooth pieces: one per vertex of a polytope, per rim circle
// of a cylinder or cone, and for an apex; an ellipsoid is one piece. The separation along n,
//   s(n) = min_j q_j(n).n - max_i p_i(n).n,
// with points p_i of a and q_j of b, is stationary on the unit sphere where weighted means p and q
// of the points of the active pieces have a difference q - p along n. Newton's method solves this
// together with the condition that the active pieces of a shape are equally high. It converges
// quadratically, where the descent (gjk.hpp) and the polytope (expanding_polytope.hpp) need a
// number of steps that grows with the ratio of the curvature radius to the distance.
#pragma once

#include "tauguard/rigid/distance.hpp"

namespace tauguard::rigid {

// Improves d->n from an approximate direction. On success lower is the separation along the new
// direction, and on_a and on_b are points whose difference is along it; false, and no change, if
// the method does not converge to better bounds. `size` is the size of the shapes.
bool sharpen(const SupportShape& a, const SupportShape& b, double size, Distance* d);

}  // namespace tauguard::rigid
