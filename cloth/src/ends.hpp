// Positions of vertices at both ends of a step.
#pragma once

#include <cstddef>
#include <cstdint>
#include <new>
#include <vector>

#include "tauguard/geometry/vec3.hpp"

namespace tauguard::cloth {

// A vector whose memory starts at a cache line, so that no vector register is loaded from two
// lines.
template <class T>
struct LineAllocator {
  using value_type = T;
  static constexpr std::align_val_t line{64};
  LineAllocator() = default;
  template <class U>
  LineAllocator(const LineAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), line)); }
  void deallocate(T* at, std::size_t) { ::operator delete(at, line); }
  bool operator==(const LineAllocator&) const { return true; }
  bool operator!=(const LineAllocator&) const { return false; }
};
template <class T>
using LineVector = std::vector<T, LineAllocator<T>>;

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
