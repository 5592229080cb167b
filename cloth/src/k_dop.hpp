// k-DOPs of moving points. On each axis a volume has either one interval for the whole step or, if
// it is *moving*, an interval at each end of the step. Two moving volumes are apart if an axis
// separates them on the same side at both ends: the difference of two points is linear in time, so
// it keeps its sign in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ends.hpp"

namespace tauguard::cloth {

// The largest number of axes, rounded up to a multiple of the vector width.
inline constexpr int most_slots = 16;

struct VolumeKind {
  int k = 18;          // 6 (axis-aligned box), 14, 16, 18 or 26
  bool moving = true;  // an interval at each end of the step, not one for the whole step
  int axes() const { return k / 2; }
  int times() const { return moving ? 2 : 1; }
  // The number of axes rounded up to 4, 8 or 16. The unused slots of points and nodes are zero, so
  // nothing is apart on them.
  int slots() const { return axes() <= 4 ? 4 : axes() <= 8 ? 8 : 16; }
};

// The k / 2 axes, with components -1, 0 or 1; x, y and z are first. Throws std::invalid_argument
// for another k.
const std::int8_t (*axes_of(int k))[3];

// Projections of the positions at both ends of the step on every axis, in float32.
//
// Coordinates are scaled into [-1, 1] by z = (x 2^a - c) 2^b, and sums of m coordinates are divided
// by 2^(m - 1), so that all magnitudes are at most 1. The absolute error is below 2^-24:
// * Scaling by powers of two is exact except for underflow. The error of x 2^a is at most 2^-1075,
//   and b is at most 1000, so the error is at most 2^-75.
// * The rounding error of the subtraction is 2^-53. For m coordinates and their sum it is 2^-52.
// * The rounding error of the conversion to float32 is 2^-25.
// Adding `pad` to the end of an interval has a rounding error of at most 2^-24 (1 + pad). Let m be
// the margin on the axis for half of the minimum distance. pad = m (1 + 2^-20) + 2^-22 covers m and
// all errors:
//   2^-22 + m 2^-20 > 2^-24 + 2^-24 (1 + 2^-22 + m (1 + 2^-20)).
//
// A bound is a float, or an integer of 16 bits where that precision suffices. The conversion is
// monotone, so that volumes that overlap also overlap in 16 bits, and minima and maxima can be
// taken after it.
inline constexpr int shorts_of_unit = 32000;
class Projection {
 public:
  // Chooses the scale for n vertices with finite coordinates.
  void scale_to(const Ends& x, std::size_t n, VolumeKind kind, double min_distance, int threads);
  // Projects the vertices, into 16 bits or floats.
  void set(const Ends& x, std::size_t n, bool in_short, int threads);

  VolumeKind kind() const { return kind_; }
  bool in_short() const { return in_short_; }
  // [end of the step][axis slot]
  const float* of(std::int32_t vertex) const {
    return values_.data() + 2 * kind_.slots() * std::size_t(vertex);
  }
  // In 16 bits, with the pad subtracted and with the pad added, [low, high][end of the step][slot].
  const std::int16_t* shorts_of(std::int32_t vertex) const {
    return shorts_.data() + 4 * kind_.slots() * std::size_t(vertex);
  }
  const float* pad() const { return pad_; }  // [axis slot]
  // The projection on x of a vector of length 1 along x.
  double unit() const { return first_ * second_; }
  std::size_t bytes() const {
    return values_.capacity() * sizeof(float) + shorts_.capacity() * sizeof(std::int16_t);
  }

 private:
  VolumeKind kind_;
  float pad_[most_slots] = {};
  double first_ = 1, second_ = 1, centre_[3] = {};  // 2^a, 2^b and c
  bool in_short_ = false;
  LineVector<float> values_;  // this or shorts_ is empty
  LineVector<std::int16_t> shorts_;
};

}  // namespace tauguard::cloth
