// MuJoCo as the plant sees it: two of its functions by address and the arrays that its Python
// binding shows. Nothing here depends on MuJoCo's headers or on the layout of its structs. Model,
// data and arrays are held, so that none of them goes away while the plant lives.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstddef>
#include <cstdint>

namespace tauguard::envs {

namespace nb = nanobind;

// An array that Python made and the plant reads or writes; it is kept alive.
using Held = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

class Physics {
 public:
  Physics(nb::object model, nb::object data, std::uintptr_t step, std::uintptr_t kinematics)
      : qpos_(nb::cast<Held>(data.attr("qpos"))),
        qvel_(nb::cast<Held>(data.attr("qvel"))),
        qfrc_applied_(nb::cast<Held>(data.attr("qfrc_applied"))),
        xfrc_applied_(nb::cast<Held>(data.attr("xfrc_applied"))),
        sensordata_(nb::cast<Held>(data.attr("sensordata"))),
        site_xpos_(nb::cast<Held>(data.attr("site_xpos"))),
        xpos_(nb::cast<Held>(data.attr("xpos"))),
        xquat_(nb::cast<Held>(data.attr("xquat"))),
        xmat_(nb::cast<Held>(data.attr("xmat"))),
        xanchor_(nb::cast<Held>(data.attr("xanchor"))),
        xaxis_(nb::cast<Held>(data.attr("xaxis"))),
        mocap_pos_(nb::cast<Held>(data.attr("mocap_pos"))),
        mocap_quat_(nb::cast<Held>(data.attr("mocap_quat"))),
        step_(reinterpret_cast<Function>(step)),
        kinematics_(reinterpret_cast<Function>(kinematics)),
        model_address_(
            reinterpret_cast<const void*>(nb::cast<std::uintptr_t>(model.attr("_address")))),
        data_address_(reinterpret_cast<void*>(nb::cast<std::uintptr_t>(data.attr("_address")))),
        model_(std::move(model)),
        data_(std::move(data)) {}

  double* qpos() const { return qpos_.data(); }
  double* qvel() const { return qvel_.data(); }
  double* applied() const { return qfrc_applied_.data(); }  // joint forces [N m]
  double* wrench(int body) const { return xfrc_applied_.data() + 6 * body; }
  const double* sensors() const { return sensordata_.data(); }
  const double* site_position(int site) const { return site_xpos_.data() + 3 * site; }
  const double* position(int body) const { return xpos_.data() + 3 * body; }
  const double* quaternion(int body) const { return xquat_.data() + 4 * body; }
  const double* rotation(int body) const { return xmat_.data() + 9 * body; }
  const double* anchor(int joint) const { return xanchor_.data() + 3 * joint; }
  double* mocap_position(int mocap) const { return mocap_pos_.data() + 3 * mocap; }
  double* mocap_quaternion(int mocap) const { return mocap_quat_.data() + 4 * mocap; }
  const double* axis(int joint) const { return xaxis_.data() + 3 * joint; }

  void step() const { step_(model_address_, data_address_); }
  void kinematics() const { kinematics_(model_address_, data_address_); }

  // Whether every position is finite and every speed below the bound; else the run has diverged.
  bool sound() const {
    for (std::size_t i = 0; i < qpos_.size(); ++i)
      if (!std::isfinite(qpos_.data()[i])) return false;
    for (std::size_t i = 0; i < qvel_.size(); ++i)
      if (!(std::fabs(qvel_.data()[i]) < velocity_bound)) return false;
    return true;
  }

 private:
  using Function = void (*)(const void*, void*);
  // Beyond this speed [rad/s, m/s] a run counts as diverged; a cobot's joints stay below 10.
  static constexpr double velocity_bound = 1e3;

  Held qpos_, qvel_, qfrc_applied_, xfrc_applied_, sensordata_, site_xpos_;
  Held xpos_, xquat_, xmat_, xanchor_, xaxis_, mocap_pos_, mocap_quat_;
  Function step_, kinematics_;
  const void* model_address_;
  void* data_address_;
  nb::object model_, data_;  // held
};

}  // namespace tauguard::envs
