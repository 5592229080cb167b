// k-DOPs of moving points. A volume either sweeps the step (one interval over both ends of the
// motion) or moves with it (an interval at each end). Moving volumes are apart where one axis
// separates them on the same side at both ends: every difference of two points is linear in time,
// so it keeps its sign in between.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "ends.hpp"

namespace tauguard::cloth {

// The largest number of axes, rounded up to a vector.
inline constexpr int most_slots = 16;

struct VolumeKind {
  int k = 18;          // 6 (axis-aligned box), 14, 16, 18 or 26
  bool moving = true;  // an interval at each end of the step, not one over both
  int axes() const { return k / 2; }
  int times() const { return moving ? 2 : 1; }
  // Axes rounded up to 4, 8 or 16: the room that points and nodes give them. Spare slots hold
  // zeros, on which nothing is ever apart.
  int slots() const { return axes() <= 4 ? 4 : axes() <= 8 ? 8 : 16; }
};

// Rows of {-1, 0, 1} of the k / 2 axes: x, y, z first. Throws std::invalid_argument for another k.
const std::int8_t (*axes_of(int k))[3];

// Positions of both ends of the step as float32 intervals' midpoints on every axis.
//
// Coordinates are first brought into [-1, 1] by z = (x 2^a - c) 2^b, sums of m coordinates are
// divided by 2^(m - 1); both make every magnitude here at most 1. Errors, absolute, against the
// exact image of x: scaling by powers of two is exact but for underflow (x 2^a is off by 2^-1075 at
// most, and b is at most 1000: 2^-75), the subtraction rounds by 2^-53, which m coordinates and
// their sum bring to 2^-52, the conversion to float32 by 2^-25: less than 2^-24 in all. Adding
// `pad` to an interval's end rounds once more, by at most 2^-24 (1 + pad). With a true margin m
// (half of the minimum distance, as seen on the axis) pad = m (1 + 2^-20) + 2^-22 covers m and both
// errors: 2^-22 + m 2^-20 > 2^-24 + 2^-24 (1 + 2^-22 + m (1 + 2^-20)).
class Projection {
 public:
  // Projects n vertices with finite coordinates.
  void set(const Ends& x, std::size_t n, VolumeKind kind, double min_distance, int threads);

  VolumeKind kind() const { return kind_; }
  // [end of the step][axis slot]
  const float* of(std::int32_t vertex) const {
    return values_.data() + 2 * kind_.slots() * std::size_t(vertex);
  }
  const float* pad() const { return pad_; }  // [axis slot]
  std::size_t bytes() const { return values_.capacity() * sizeof(float); }

 private:
  VolumeKind kind_;
  float pad_[most_slots] = {};
  std::vector<float> values_;
};

}  // namespace tauguard::cloth
