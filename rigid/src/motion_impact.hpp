// First contact of two moving convex bodies, from below.
#pragma once

#include "motion_body.hpp"

namespace tauguard::rigid {

struct Impact {
  double t;     // the bodies are certainly apart on [start, t)
  bool hit;     // false: apart on all of [start, end]
  Vec normal;   // unit, from a to b: the last separating direction
};

// Advances from `start` as long as the bodies are further apart than `gap` plus rounding; with gap = 0 the
// time it stops at is the time of impact, never late. A positive gap stops early, which a caller that
// only prunes is glad of.
Impact first_contact(MovingBody& a, MovingBody& b, double start, double end, double gap = 0);

// Row `r` of a batch, placed by `motion`.
MovingBody moving_body(const Bodies& bodies, std::size_t r, const RigidMotion& motion, const Vec& origin);
// Any point set with its faces' normals and edges taken as a triangle's.
MovingBody moving_triangle(const double v[3][3], const RigidMotion& motion, const Vec& origin);
MovingBody moving_box(const Vec& centre, const Vec& extent, const RigidMotion& motion, const Vec& origin);

// A direction that separates the point sets, found by GJK; false where they meet to rounding.
bool separating_direction(const std::vector<Vec>& a, const std::vector<Vec>& b, Vec* n, double* separation);

}  // namespace tauguard::rigid
