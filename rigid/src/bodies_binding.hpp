// Batches of bodies and of motions, as arrays from Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <optional>

#include "first_touch.hpp"
#include "hull_index.hpp"
#include "posed_body.hpp"
#include "signed_distance.hpp"
#include "tauguard/geometry/interrupt_binding.hpp"
#include "tauguard/rigid/moving_body.hpp"

namespace tauguard::rigid {

using Packed =
    nanobind::ndarray<const double, nanobind::ndim<2>, nanobind::c_contig, nanobind::device::cpu>;
using Offsets = nanobind::ndarray<const std::int64_t, nanobind::ndim<1>, nanobind::c_contig,
                                  nanobind::device::cpu>;
using Radii =
    nanobind::ndarray<const double, nanobind::ndim<1>, nanobind::c_contig, nanobind::device::cpu>;
using Poses = nanobind::ndarray<const double, nanobind::shape<-1, 4, 4>, nanobind::c_contig,
                                nanobind::device::cpu>;
using Vectors = nanobind::ndarray<const double, nanobind::shape<-1, 3>, nanobind::c_contig,
                                  nanobind::device::cpu>;

// One row per pair: time of impact, point, normal.
using Touches =
    nanobind::ndarray<double, nanobind::shape<-1, 7>, nanobind::c_contig, nanobind::device::cpu>;

inline void store(const FirstTouch& t, double* row) {
  row[0] = t.toi;
  for (int k = 0; k < 3; ++k) row[1 + k] = t.point[k], row[4 + k] = t.normal[k];
}

// A batch of bodies, each grown by a ball: one radius for each row, or one for all. Poses, if any,
// move them: one for all bodies, or one per row. It keeps the Python arrays alive.
struct Batch : Bodies {
  Batch(int kind, Packed data, Offsets offsets, Radii radii, std::optional<Poses> poses,
        const HullIndex* index)
      : Bodies{static_cast<Kind>(kind), data.data(), offsets.data(),
               is_cloud(static_cast<Kind>(kind)) ? offsets.shape(0) - 1 : data.shape(0)},
        data_(data),
        offsets_(offsets),
        radii_(radii),
        poses_(poses),
        index_(index) {}
  double radius(std::size_t i) const { return radii_.data()[radii_.shape(0) == 1 ? 0 : i]; }
  bool sharp() const { return radii_.shape(0) == 1 && radii_.data()[0] == 0; }
  // The largest magnitude of the numbers.
  double largest() const {
    double most = 0;
    for (std::size_t i = 0; i < data_.size(); ++i)
      most = std::max(most, std::fabs(data_.data()[i]));
    return most;
  }
  const HullIndex* index() const { return index_; }
  bool in_place() const { return !poses_; }
  // The pose of row i; null without poses.
  const double* pose(std::size_t i) const {
    return poses_ ? poses_->data() + 16 * (poses_->shape(0) == 1 ? 0 : i) : nullptr;
  }

 private:
  Packed data_;
  Offsets offsets_;
  Radii radii_;
  std::optional<Poses> poses_;
  const HullIndex* index_;
};

// The bodies of a batch at their poses, row by row.
class Posed {
 public:
  explicit Posed(const Batch& batch) : batch_(batch) {}
  PosedRow row(std::size_t i) const { return {batch_, i, batch_.pose(i), batch_.index()}; }
  // Bodies whose row i is the body; valid until the next call.
  const Bodies& at(std::size_t i) {
    const double* pose = batch_.pose(i);
    return pose ? body_.place(batch_, i, pose) : batch_;
  }

 private:
  const Batch& batch_;
  PosedBody body_;
};

// Calls body(i, x, y) for all rows, with both sides at their poses. `grain`: rows a task.
template <class Body>
void each_pair(const Batch& a, const Batch& b, std::size_t rows, int threads, std::size_t grain,
               const Body& body) {
  geometry::interruptible_for(rows, threads, grain, [&](auto begin, auto end, auto) {
    Posed x(a), y(b);
    for (auto i = begin; i < end; ++i) body(i, x, y);
  });
}

// A batch of motions: one for all rows of the query, or one per row.
struct Motions {
  Poses pose;
  Vectors linear, angular;
  RigidMotion operator[](std::size_t i) const {
    const std::size_t r = pose.shape(0) == 1 ? 0 : i;
    return RigidMotion(pose.data() + 16 * r, linear.data() + 3 * r, angular.data() + 3 * r);
  }
};

}  // namespace tauguard::rigid
