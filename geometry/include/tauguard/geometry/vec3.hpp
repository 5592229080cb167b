// 3-vectors over any number type: doubles (Vec3), exact numbers, or several doubles side by side
// (lanes.hpp). Products are written out, so the order of operations is the same in every kernel.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace tauguard::geometry {

// Functions that a kernel calls must be inlined into the function that has the target attribute.
#define TAUGUARD_INLINE inline __attribute__((always_inline))

template <class T>
struct Vector3 {
  T x{}, y{}, z{};

  T* data() { return reinterpret_cast<T*>(this); }
  const T* data() const { return reinterpret_cast<const T*>(this); }
  T* begin() { return data(); }
  T* end() { return data() + 3; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + 3; }
  T& operator[](std::size_t k) { return data()[k]; }
  const T& operator[](std::size_t k) const { return data()[k]; }

  friend TAUGUARD_INLINE Vector3 operator+(const Vector3& a, const Vector3& b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z};
  }
  friend TAUGUARD_INLINE Vector3 operator-(const Vector3& a, const Vector3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend TAUGUARD_INLINE Vector3 operator-(const Vector3& a) { return {-a.x, -a.y, -a.z}; }
  friend TAUGUARD_INLINE Vector3 operator*(const T& s, const Vector3& a) {
    return {s * a.x, s * a.y, s * a.z};
  }
  friend TAUGUARD_INLINE Vector3& operator+=(Vector3& a, const Vector3& b) { return a = a + b; }
  friend bool operator==(const Vector3& a, const Vector3& b) {
    return a.x == b.x && a.y == b.y && a.z == b.z;
  }
  friend TAUGUARD_INLINE T dot(const Vector3& a, const Vector3& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
  }
  friend TAUGUARD_INLINE Vector3 cross(const Vector3& a, const Vector3& b) {
    return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
  }
  // Linear interpolation from a (t = 0) to b (t = 1).
  friend TAUGUARD_INLINE Vector3 mix(const Vector3& a, const Vector3& b, const T& t) {
    return a + t * (b - a);
  }
};

using Vec3 = Vector3<double>;
static_assert(sizeof(Vec3) == 3 * sizeof(double));

inline Vec3 load(const double* p) { return {p[0], p[1], p[2]}; }
inline double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }
// The largest magnitude of a component.
inline double largest(const Vec3& a) {
  return std::max({std::fabs(a.x), std::fabs(a.y), std::fabs(a.z)});
}
// The index of the component of smallest magnitude.
inline int smallest_axis(const Vec3& a) {
  const double x = std::fabs(a.x), y = std::fabs(a.y), z = std::fabs(a.z);
  return x < y ? (x < z ? 0 : 2) : (y < z ? 1 : 2);
}

// A 3x3 matrix in row-major order.
struct Mat3 {
  double m[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
};

inline Vec3 operator*(const Mat3& a, const Vec3& v) {
  return {a.m[0] * v.x + a.m[1] * v.y + a.m[2] * v.z, a.m[3] * v.x + a.m[4] * v.y + a.m[5] * v.z,
          a.m[6] * v.x + a.m[7] * v.y + a.m[8] * v.z};
}

// The transpose of `a` times `v`: from the parent's axes to the child's.
inline Vec3 transposed(const Mat3& a, const Vec3& v) {
  return {a.m[0] * v.x + a.m[3] * v.y + a.m[6] * v.z, a.m[1] * v.x + a.m[4] * v.y + a.m[7] * v.z,
          a.m[2] * v.x + a.m[5] * v.y + a.m[8] * v.z};
}

}  // namespace tauguard::geometry
