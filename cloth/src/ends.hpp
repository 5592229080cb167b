// Positions of vertices at both ends of a step.
#pragma once

#include <cstddef>
#include <cstdint>

#include "tauguard/geometry/vec3.hpp"

namespace tauguard::cloth {

struct Ends {
  const double *t0, *t1;
  std::ptrdiff_t stride;  // doubles from one vertex to the next

  // The caller's arrays, shape (n, 3).
  static Ends of(const double* x_t0, const double* x_t1) { return {x_t0, x_t1, 3}; }
  // Both ends of a vertex in one cache line: x, y, z, 0 at the start, then at the end of the step.
  static constexpr std::ptrdiff_t line = 8;
  static Ends packed(const double* lines) { return {lines, lines + 4, line}; }
  bool in_lines() const { return stride == line; }

  const double* at(bool end, std::int32_t v) const { return (end ? t1 : t0) + stride * v; }
  geometry::Vec3 operator()(bool end, std::int32_t v) const { return geometry::load(at(end, v)); }
};

}  // namespace tauguard::cloth
