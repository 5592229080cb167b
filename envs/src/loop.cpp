// The simulation loop, compiled: position control, drive and mj_step at every time step, rows
// recorded.
//
// MuJoCo is reached through the address of mj_step and the addresses of the arrays that its Python
// binding shows, so nothing here depends on MuJoCo's headers or on the layout of its structs. Row k
// of every output belongs to the state before step k: q and qd are read before mj_step, sensors and
// body poses after it, because mj_step evaluates them at the state it starts from.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "drive.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace nb = nanobind;
using tauguard::envs::Joint;
using tauguard::envs::JointState;

namespace {

template <typename T>
T* pointer(std::uintptr_t address) {
  return reinterpret_cast<T*>(address);
}

using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Rows = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using MutableVector = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

class Loop {
 public:
  Loop(std::uintptr_t step, std::uintptr_t model, std::uintptr_t data, double dt, double decay,
       std::uintptr_t qpos, std::uintptr_t qvel, std::uintptr_t qfrc_applied,
       std::uintptr_t xfrc_applied, std::uintptr_t xpos, std::uintptr_t xquat,
       std::uintptr_t sensordata, std::vector<int> qpos_adr, std::vector<int> dof_adr,
       std::vector<int> obstacle_bodies, int sensor_begin, int sensor_count)
      : step_(reinterpret_cast<Step>(step)),
        model_(pointer<void>(model)),
        data_(pointer<void>(data)),
        dt_(dt),
        decay_(decay),
        qpos_(pointer<double>(qpos)),
        qvel_(pointer<double>(qvel)),
        qfrc_(pointer<double>(qfrc_applied)),
        xfrc_(pointer<double>(xfrc_applied)),
        xpos_(pointer<double>(xpos)),
        xquat_(pointer<double>(xquat)),
        sensors_(pointer<double>(sensordata)),
        qpos_adr_(std::move(qpos_adr)),
        dof_adr_(std::move(dof_adr)),
        obstacles_(std::move(obstacle_bodies)),
        sensor_begin_(sensor_begin),
        sensor_count_(sensor_count),
        joints_(qpos_adr_.size()),
        states_(qpos_adr_.size()) {}

  std::size_t joints() const { return joints_.size(); }

  void set_joint(std::size_t i, double gain, double nominal_gain, double limit, double gear,
                 double coulomb, double breakaway, double stribeck_velocity, double viscous,
                 double bristle_stiffness, double load, double kp, double kd,
                 std::vector<double> cycles, std::vector<double> amplitude,
                 std::vector<double> phase) {
    joints_.at(i) = Joint{gain,
                          nominal_gain,
                          limit,
                          gear,
                          coulomb,
                          breakaway,
                          stribeck_velocity,
                          viscous,
                          bristle_stiffness,
                          load,
                          kp,
                          kd,
                          std::move(cycles),
                          std::move(amplitude),
                          std::move(phase)};
  }

  void get_state(MutableVector out) const {
    for (std::size_t i = 0; i < states_.size(); ++i) {
      out.data()[2 * i] = states_[i].current;
      out.data()[2 * i + 1] = states_[i].bristle;
    }
  }

  void set_state(Vector in) {
    for (std::size_t i = 0; i < states_.size(); ++i)
      states_[i] = JointState{in.data()[2 * i], in.data()[2 * i + 1]};
  }

  // Runs rows(q_des) steps and fills q, qd, current, sensor and poses; returns how many steps were
  // sound (all of them unless the simulation diverged). The wrench table (rows x 6: force, torque
  // about the body's centre of mass, world frame) acts on wrench_body; pass 0 rows for none.
  std::size_t run(Table q_des, Table qd_des, Table tau_ff, Table wrench, int wrench_body, Rows q,
                  Rows qd, Rows current, Rows sensor, Rows poses) {
    nb::gil_scoped_release release;
    const tauguard::geometry::RoundToNearest guard;
    const std::size_t rows = q_des.shape(0), n = joints_.size();
    const bool pushed = wrench.shape(0) == rows && wrench_body > 0;
    double* applied = pushed ? xfrc_ + 6 * static_cast<std::size_t>(wrench_body) : nullptr;
    std::size_t sound = rows;
    for (std::size_t k = 0; k < rows; ++k) {
      bool finite = true;
      for (std::size_t i = 0; i < n; ++i) {
        const double position = qpos_[qpos_adr_[i]], velocity = qvel_[dof_adr_[i]];
        finite = finite && std::isfinite(position) && std::fabs(velocity) < velocity_bound;
        q.data()[k * n + i] = position;
        qd.data()[k * n + i] = velocity;
        const std::size_t at = k * n + i;
        current.data()[at] =
            drive(i, position, velocity, q_des.data()[at], qd_des.data()[at], tau_ff.data()[at]);
      }
      if (!finite) {
        sound = k;
        break;
      }
      if (pushed) std::memcpy(applied, wrench.data() + 6 * k, 6 * sizeof(double));
      step_(model_, data_);
      record(k, sensor.data(), poses.data());
    }
    if (pushed) std::memset(applied, 0, 6 * sizeof(double));
    return sound;
  }

 private:
  using Step = void (*)(const void*, void*);
  // Beyond this joint speed [rad/s] a run counts as diverged; a cobot's joints stay below 10.
  static constexpr double velocity_bound = 1e3;

  double drive(std::size_t i, double q, double qd, double q_des, double qd_des, double tau_ff) {
    const Joint& j = joints_[i];
    JointState& s = states_[i];
    double command = (tau_ff + j.kp * (q_des - q) + j.kd * (qd_des - qd)) / j.nominal_gain;
    command = std::min(std::max(command, -j.current_limit), j.current_limit);
    s.current = command + (s.current - command) * decay_;
    const double tau = j.gain * s.current;
    const double lost = tauguard::envs::friction(j, s, qd, tau, dt_);
    qfrc_[dof_adr_[i]] = tau - lost + tauguard::envs::ripple(j, q);
    return s.current;
  }

  void record(std::size_t k, double* sensor, double* poses) const {
    if (sensor_count_)
      std::memcpy(sensor + k * static_cast<std::size_t>(sensor_count_), sensors_ + sensor_begin_,
                  static_cast<std::size_t>(sensor_count_) * sizeof(double));
    for (std::size_t b = 0; b < obstacles_.size(); ++b) {
      double* row = poses + (k * obstacles_.size() + b) * 7;
      std::memcpy(row, xpos_ + 3 * obstacles_[b], 3 * sizeof(double));
      std::memcpy(row + 3, xquat_ + 4 * obstacles_[b], 4 * sizeof(double));
    }
  }

  Step step_;
  void *model_, *data_;
  double dt_, decay_;
  double *qpos_, *qvel_, *qfrc_, *xfrc_, *xpos_, *xquat_, *sensors_;
  std::vector<int> qpos_adr_, dof_adr_, obstacles_;
  int sensor_begin_, sensor_count_;
  std::vector<Joint> joints_;
  std::vector<JointState> states_;
};

}  // namespace

NB_MODULE(_loop, m) {
  nb::class_<Loop>(m, "Loop")
      .def(nb::init<std::uintptr_t, std::uintptr_t, std::uintptr_t, double, double, std::uintptr_t,
                    std::uintptr_t, std::uintptr_t, std::uintptr_t, std::uintptr_t, std::uintptr_t,
                    std::uintptr_t, std::vector<int>, std::vector<int>, std::vector<int>, int,
                    int>(),
           nb::arg("step"), nb::arg("model"), nb::arg("data"), nb::arg("dt"), nb::arg("decay"),
           nb::arg("qpos"), nb::arg("qvel"), nb::arg("qfrc_applied"), nb::arg("xfrc_applied"),
           nb::arg("xpos"), nb::arg("xquat"), nb::arg("sensordata"), nb::arg("qpos_adr"),
           nb::arg("dof_adr"), nb::arg("obstacle_bodies"), nb::arg("sensor_begin"),
           nb::arg("sensor_count"))
      .def("set_joint", &Loop::set_joint, nb::arg("i"), nb::arg("gain"), nb::arg("nominal_gain"),
           nb::arg("limit"), nb::arg("gear"), nb::arg("coulomb"), nb::arg("breakaway"),
           nb::arg("stribeck_velocity"), nb::arg("viscous"), nb::arg("bristle_stiffness"),
           nb::arg("load"), nb::arg("kp"), nb::arg("kd"), nb::arg("cycles"), nb::arg("amplitude"),
           nb::arg("phase"))
      .def("get_state", &Loop::get_state, nb::arg("out"))
      .def("set_state", &Loop::set_state, nb::arg("state"))
      .def("run", &Loop::run, nb::arg("q_des"), nb::arg("qd_des"), nb::arg("tau_ff"),
           nb::arg("wrench"), nb::arg("wrench_body"), nb::arg("q"), nb::arg("qd"),
           nb::arg("current"), nb::arg("sensor"), nb::arg("poses"))
      .def_prop_ro("joints", &Loop::joints);
}
