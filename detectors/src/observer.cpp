// tauguard.detectors._observer: rigid-body terms and the momentum observer, one row or many.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "rigid_body.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace tauguard::detectors;
using tauguard::geometry::RoundToNearest;
using tauguard::geometry::ThreadPool;

namespace {

using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<const double, nb::ndim<3>, nb::c_contig, nb::device::cpu>;
using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using OutVector = nb::ndarray<double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

Vec vec(const double* p) { return {p[0], p[1], p[2]}; }
Mat mat(const double* p, int stride) { return {{vec(p), vec(p + stride), vec(p + 2 * stride)}}; }

Robot make_robot(const std::vector<int>& parents, const std::vector<bool>& prismatic, Cube placements,
                 Matrix axes, Vector masses, Matrix coms, Cube inertias, Vector armature, Vector gravity) {
  Robot robot;
  robot.gravity = vec(gravity.data());
  for (std::size_t i = 0; i < parents.size(); ++i) {
    const double* at = placements.data() + 16 * i;
    Joint j;
    j.parent = parents[i];
    j.prismatic = prismatic[i];
    j.rotation = mat(at, 4);
    j.position = {at[3], at[7], at[11]};
    j.axis = vec(axes.data() + 3 * i);
    j.mass = masses.data()[i];
    j.com = vec(coms.data() + 3 * i);
    j.inertia = mat(inertias.data() + 9 * i, 3);
    j.armature = armature.data()[i];
    robot.joints.push_back(j);
  }
  return robot;
}

// The generalised-momentum observer (De Luca & Mattone 2003), discretised exactly for a tau_ext that is
// constant over the step, beta averaged over it:
//   r += (1 - exp(-K dt)) ((p_k - p_{k-1}) / dt - (tau_{k-1} + (beta_k + beta_{k-1}) / 2) - r)
class Observer {
 public:
  Observer(const Robot& robot, Vector gain)
      : robot_(robot), work_(robot.size()), gain_(gain.data(), gain.data() + gain.shape(0)) {
    if (gain_.size() != robot.size()) throw std::invalid_argument("gain: one number a joint");
    for (auto* v : {&p_, &beta_, &tau_, &r_, &next_p_, &next_beta_}) v->assign(robot.size(), 0.0);
  }

  void reset() {
    std::fill(r_.begin(), r_.end(), 0.0);
    started_ = false;
  }

  void advance(double dt, const double* q, const double* qd, const double* tau, double* out) {
    const std::size_t n = robot_.size();
    robot_.momentum(q, qd, next_p_.data(), next_beta_.data(), work_);
    if (started_) {
      for (std::size_t i = 0; i < n; ++i) {
        const double seen = (next_p_[i] - p_[i]) / dt - (tau_[i] + 0.5 * (next_beta_[i] + beta_[i]));
        r_[i] += -std::expm1(-gain_[i] * dt) * (seen - r_[i]);
      }
    }
    started_ = true;
    p_.swap(next_p_);
    beta_.swap(next_beta_);
    for (std::size_t i = 0; i < n; ++i) {
      tau_[i] = tau[i];
      out[i] = r_[i];
    }
  }

  void step(double dt, Vector q, Vector qd, Vector tau, OutVector out) {
    const RoundToNearest guard;
    advance(dt, q.data(), qd.data(), tau.data(), out.data());
  }

  void run(Vector t, Matrix q, Matrix qd, Matrix tau, Out out) {
    nb::gil_scoped_release release;
    const RoundToNearest guard;
    reset();
    const std::size_t n = robot_.size();
    for (std::size_t k = 0; k < t.shape(0); ++k) {
      const double dt = k ? t.data()[k] - t.data()[k - 1] : 1.0;
      advance(dt, q.data() + k * n, qd.data() + k * n, tau.data() + k * n, out.data() + k * n);
    }
  }

 private:
  const Robot& robot_;
  Workspace work_;
  std::vector<double> gain_, p_, beta_, tau_, r_, next_p_, next_beta_;
  bool started_ = false;
};

void momentum(const Robot& robot, Matrix q, Matrix qd, Out p, Out beta, int threads) {
  nb::gil_scoped_release release;
  const std::size_t n = robot.size();
  ThreadPool::shared().parallel_for(q.shape(0), threads, 1024, [&](auto begin, auto end, auto) {
    Workspace work(n);
    for (auto k = begin; k < end; ++k)
      robot.momentum(q.data() + k * n, qd.data() + k * n, p.data() + k * n, beta.data() + k * n, work);
  });
}

void inverse(const Robot& robot, Matrix q, Matrix qd, Matrix qdd, Out tau, int threads) {
  nb::gil_scoped_release release;
  const std::size_t n = robot.size();
  ThreadPool::shared().parallel_for(q.shape(0), threads, 1024, [&](auto begin, auto end, auto) {
    Workspace work(n);
    for (auto k = begin; k < end; ++k)
      robot.inverse(q.data() + k * n, qd.data() + k * n, qdd.data() + k * n, tau.data() + k * n, work);
  });
}

}  // namespace

NB_MODULE(_observer, m) {
  nb::class_<Robot>(m, "Robot").def_prop_ro("joints", &Robot::size);
  m.def("make_robot", &make_robot, nb::arg("parents"), nb::arg("prismatic"), nb::arg("placements"),
        nb::arg("axes"), nb::arg("masses"), nb::arg("coms"), nb::arg("inertias"), nb::arg("armature"),
        nb::arg("gravity"));
  m.def("momentum", &momentum, nb::arg("robot"), nb::arg("q"), nb::arg("qd"), nb::arg("p"),
        nb::arg("beta"), nb::arg("threads"));
  m.def("inverse", &inverse, nb::arg("robot"), nb::arg("q"), nb::arg("qd"), nb::arg("qdd"), nb::arg("tau"),
        nb::arg("threads"));
  nb::class_<Observer>(m, "Observer")
      .def(nb::init<const Robot&, Vector>(), nb::arg("robot"), nb::arg("gain"), nb::keep_alive<1, 2>())
      .def("reset", &Observer::reset)
      .def("step", &Observer::step, nb::arg("dt"), nb::arg("q"), nb::arg("qd"), nb::arg("tau"),
           nb::arg("out"))
      .def("run", &Observer::run, nb::arg("t"), nb::arg("q"), nb::arg("qd"), nb::arg("tau"), nb::arg("out"));
}
