// For comparison only: single bounding volumes as in textbooks. The study measures three steps:
// 1. Fit a volume in the body's frame.
// 2. Place it in the world under a pose. A ball and an oriented box move with the pose; bounds
//    along fixed directions are computed again from the posed corners.
// 3. Test volumes against each other.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "comparison_volumes.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::rigid;

using Corners = nb::ndarray<const double, nb::shape<-1, 3, 3>, nb::c_contig, nb::device::cpu>;
using Offsets = nb::ndarray<const std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Poses = nb::ndarray<const double, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<const std::int64_t, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<bool, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Bounds = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

namespace {

constexpr double world[3] = {0, 0, 0};

// A volume with fixed directions, computed from the posed corners.
template <class Volume>
Volume refitted(const Cluster& body, const Pose& pose) {
  static thread_local std::vector<Triangle> posed;
  posed.clear();
  for (const Triangle* t = body.begin; t != body.end; ++t) posed.push_back(pose.apply(*t));
  return Volume::fit({posed.data(), posed.data() + posed.size(), world});
}

struct BallVolume : Ball {
  static BallVolume fit(const Cluster& c) { return {Ball::fit(c)}; }
  static BallVolume placed(const BallVolume& v, const Cluster&, const Pose& pose) {
    BallVolume out = v;
    pose.apply(v.centre, out.centre);
    return out;
  }
  static bool meet(const BallVolume& a, const BallVolume& b) {
    double square = 0;
    for (int k = 0; k < 3; ++k) square += (a.centre[k] - b.centre[k]) * (a.centre[k] - b.centre[k]);
    return square <= (a.radius + b.radius) * (a.radius + b.radius);
  }
  static constexpr std::size_t numbers = 4;
  void write(double* out) const { std::copy_n(centre, 3, out), out[3] = radius; }
};

struct AabbVolume : tauguard::geometry::Aabb {
  static AabbVolume fit(const Cluster& c) {
    AabbVolume out;
    for (const Triangle* t = c.begin; t != c.end; ++t)
      for (const auto& v : t->v) out.add(v);
    return out;
  }
  static AabbVolume placed(const AabbVolume&, const Cluster& body, const Pose& pose) {
    return refitted<AabbVolume>(body, pose);
  }
  static bool meet(const AabbVolume& a, const AabbVolume& b) { return a.overlaps(b); }
  static constexpr std::size_t numbers = 6;
  void write(double* out) const { std::copy_n(lo, 3, out), std::copy_n(hi, 3, out + 3); }
};

struct ObbVolume : Obb {
  static ObbVolume fit(const Cluster& c) { return {Obb::fit(c)}; }
  static ObbVolume placed(const ObbVolume& v, const Cluster&, const Pose& pose) {
    ObbVolume out = v;
    pose.apply(v.centre, out.centre);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k)
        out.axis[i][k] =
            pose.r[k][0] * v.axis[i][0] + pose.r[k][1] * v.axis[i][1] + pose.r[k][2] * v.axis[i][2];
    return out;
  }
  static bool meet(const ObbVolume& a, const ObbVolume& b) {
    return Obb::meet(a, b, Frame::same());
  }
  static constexpr std::size_t numbers = 15;
  void write(double* out) const {
    std::copy_n(centre, 3, out), std::copy_n(extent, 3, out + 3),
        std::copy_n(&axis[0][0], 9, out + 6);
  }
};

struct KDopVolume : KDop {
  static KDopVolume fit(const Cluster& c) { return {KDop::fit(c)}; }
  static KDopVolume placed(const KDopVolume&, const Cluster& body, const Pose& pose) {
    return refitted<KDopVolume>(body, pose);
  }
  static bool meet(const KDopVolume& a, const KDopVolume& b) {
    for (int k = 0; k < directions; ++k)
      if (a.lo[k] > b.hi[k] || b.lo[k] > a.hi[k]) return false;
    return true;
  }
  static constexpr std::size_t numbers = 2 * directions;
  void write(double* out) const {
    std::copy_n(lo, directions, out), std::copy_n(hi, directions, out + directions);
  }
};

// Bodies: each is a range of triangles and has one volume.
template <class Volume>
class Volumes {
 public:
  Volumes(Corners corners, Offsets offsets)
      : triangles_(corners.shape(0)), offsets_(offsets.data(), offsets.data() + offsets.shape(0)) {
    std::copy_n(corners.data(), 9 * triangles_.size(), &triangles_.data()->v[0][0]);
    fit();
  }
  void fit() {
    fitted_.resize(offsets_.size() - 1);
    for (std::size_t i = 0; i < fitted_.size(); ++i) fitted_[i] = Volume::fit(body(i));
    placed_ = fitted_;
  }
  void place(Poses poses) {
    for (std::size_t i = 0; i < fitted_.size(); ++i)
      placed_[i] = Volume::placed(fitted_[i], body(i), Pose(poses.data() + 16 * i));
  }
  void meet(Rows pairs, Flags out) const {
    for (std::size_t i = 0; i < pairs.shape(0); ++i)
      out.data()[i] = Volume::meet(placed_[pairs.data()[2 * i]], placed_[pairs.data()[2 * i + 1]]);
  }
  // Writes the numbers that describe every volume, in the world frame.
  void write(Bounds out) const {
    for (std::size_t i = 0; i < placed_.size(); ++i)
      placed_[i].write(out.data() + Volume::numbers * i);
  }

 private:
  Cluster body(std::size_t i) const {
    return {triangles_.data() + offsets_[i], triangles_.data() + offsets_[i + 1], world};
  }

  std::vector<Triangle> triangles_;
  std::vector<std::int64_t> offsets_;
  std::vector<Volume> fitted_, placed_;
};

template <class Volume>
void bind(nb::module_& m, const char* name) {
  const auto release = nb::call_guard<nb::gil_scoped_release>();
  nb::class_<Volumes<Volume>>(m, name)
      .def(nb::init<Corners, Offsets>(), "corners"_a, "offsets"_a)
      .def("fit", &Volumes<Volume>::fit, release)
      .def("place", &Volumes<Volume>::place, "poses"_a, release)
      .def("meet", &Volumes<Volume>::meet, "pairs"_a, "out"_a, release)
      .def("write", &Volumes<Volume>::write, "out"_a, release)
      .def_ro_static("numbers", &Volume::numbers);
}

}  // namespace

void bind_volumes(nb::module_& m) {
  bind<BallVolume>(m, "BallVolumes");
  bind<AabbVolume>(m, "AabbVolumes");
  bind<ObbVolume>(m, "ObbVolumes");
  bind<KDopVolume>(m, "KDopVolumes");
}
