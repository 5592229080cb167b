// Access to MuJoCo: addresses of three functions, and arrays of one model's data. No MuJoCo header,
// no layout of its structs and no Python is needed here. `Engine::owner` keeps the arrays alive.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <memory>

namespace tauguard::envs {

// A row-major array of doubles that the plant reads or writes; `owner`, if given, keeps it alive.
class Held {
 public:
  Held() = default;
  Held(double* data, std::initializer_list<std::size_t> shape,
       std::shared_ptr<const void> owner = nullptr)
      : data_(data), owner_(std::move(owner)) {
    for (const std::size_t extent : shape) add_axis(extent);
  }
  void add_axis(std::size_t extent) { shape_.at(axes_++) = extent; }

  double* data() const { return data_; }
  std::size_t shape(std::size_t axis) const { return shape_.at(axis); }
  std::size_t size() const {
    std::size_t all = axes_ ? 1 : 0;
    for (std::size_t k = 0; k < axes_; ++k) all *= shape_[k];
    return all;
  }

 private:
  double* data_ = nullptr;
  std::size_t axes_ = 0;
  std::array<std::size_t, 3> shape_{};
  std::shared_ptr<const void> owner_;
};

// Functions of MuJoCo, fields of its data under MuJoCo's names, and their owner.
struct Engine {
  using Function = void (*)(const void*, void*);
  const void* model = nullptr;
  void* data = nullptr;
  Function step = nullptr, kinematics = nullptr;
  using Distance = double (*)(const void*, const void*, int, int, double, double*);
  Distance distance = nullptr;
  std::size_t nq = 0, nv = 0;
  double *qpos = nullptr, *qvel = nullptr, *qfrc_applied = nullptr, *xfrc_applied = nullptr;
  double *sensordata = nullptr, *site_xpos = nullptr, *xpos = nullptr, *xquat = nullptr;
  double *xmat = nullptr, *xanchor = nullptr, *xaxis = nullptr;
  double *mocap_pos = nullptr, *mocap_quat = nullptr;
  double *geom_xpos = nullptr, *geom_xmat = nullptr;
  const double* geom_rbound = nullptr;
  std::shared_ptr<const void> owner;
};

class Physics {
 public:
  explicit Physics(Engine engine) : e_(std::move(engine)) {}

  double* qpos() const { return e_.qpos; }
  double* qvel() const { return e_.qvel; }
  double* applied() const { return e_.qfrc_applied; }  // joint forces [N m]
  double* wrench(int body) const { return e_.xfrc_applied + 6 * body; }
  const double* sensors() const { return e_.sensordata; }
  const double* site_position(int site) const { return e_.site_xpos + 3 * site; }
  const double* position(int body) const { return e_.xpos + 3 * body; }
  const double* quaternion(int body) const { return e_.xquat + 4 * body; }
  const double* rotation(int body) const { return e_.xmat + 9 * body; }
  const double* anchor(int joint) const { return e_.xanchor + 3 * joint; }
  double* mocap_position(int mocap) const { return e_.mocap_pos + 3 * mocap; }
  double* mocap_quaternion(int mocap) const { return e_.mocap_quat + 4 * mocap; }
  const double* axis(int joint) const { return e_.xaxis + 3 * joint; }

  const double* geom_position(int geom) const { return e_.geom_xpos + 3 * geom; }
  const double* geom_rotation(int geom) const { return e_.geom_xmat + 9 * geom; }
  double bounding_radius(int geom) const { return e_.geom_rbound[geom]; }

  // Distance of two geoms, up to `most` [m], and their nearest points.
  double distance(int first, int second, double most, double* points) const {
    return e_.distance(e_.model, e_.data, first, second, most, points);
  }

  // While an object of this class lives, a geom is at another place.
  class Moved {
   public:
    Moved(const Physics& physics, int geom, const double* centre, const double* quat_wxyz)
        : place_(physics.e_.geom_xpos + 3 * geom), turn_(physics.e_.geom_xmat + 9 * geom) {
      std::copy_n(place_, 3, before_.data());
      std::copy_n(turn_, 9, before_.data() + 3);
      std::copy_n(centre, 3, place_);
      const double w = quat_wxyz[0], x = quat_wxyz[1], y = quat_wxyz[2], z = quat_wxyz[3];
      const double rows[9] = {
          1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
      std::copy_n(rows, 9, turn_);
    }
    ~Moved() {
      std::copy_n(before_.data(), 3, place_);
      std::copy_n(before_.data() + 3, 9, turn_);
    }
    Moved(const Moved&) = delete;
    Moved& operator=(const Moved&) = delete;

   private:
    double *place_, *turn_;
    std::array<double, 12> before_;
  };

  void step() const { e_.step(e_.model, e_.data); }
  void kinematics() const { e_.kinematics(e_.model, e_.data); }

  // Whether every position is finite and every speed below the bound; else the run has diverged.
  bool sound() const {
    for (std::size_t i = 0; i < e_.nq; ++i)
      if (!std::isfinite(e_.qpos[i])) return false;
    for (std::size_t i = 0; i < e_.nv; ++i)
      if (!(std::fabs(e_.qvel[i]) < velocity_bound)) return false;
    return true;
  }

 private:
  // Beyond this speed [rad/s, m/s] a run counts as diverged; a cobot's joints stay below 10.
  static constexpr double velocity_bound = 1e3;

  Engine e_;
};

}  // namespace tauguard::envs
