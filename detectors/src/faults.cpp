// tauguard.detectors._faults: faults that a stream of samples shows by itself.
#include "faults.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "bindings.hpp"
#include "torques.hpp"

namespace tauguard::detectors {
namespace {

std::vector<double> values(const In1& x) { return {x.data(), x.data() + x.shape(0)}; }

class Check {
 public:
  Check(double dt, double longest, std::int64_t odd, double speed, std::int64_t repeats,
        std::int64_t window, double share, double step_share, In1 current, In1 step, In1 drift,
        Ids stuck)
      : n_(current.shape(0)),
        check_(usual(dt, longest, odd, speed, repeats, window, share, step_share, current, step,
                     drift, stuck)) {}

  std::tuple<int, int, double> step(double t, In1 q, In1 qd, In1 current) {
    require(q.shape(0) == n_ && qd.shape(0) == n_ && current.shape(0) == n_,
            "q, qd, current: expected one entry a joint");
    const Verdict v = check_.step(t, q.data(), qd.data(), current.data());
    return {static_cast<int>(v.fault), v.joint, v.value};
  }

  void reset() { check_.reset(); }

 private:
  static Usual usual(double dt, double longest, std::int64_t odd, double speed,
                     std::int64_t repeats, std::int64_t window, double share, double step_share,
                     const In1& current, const In1& step, const In1& drift, const Ids& stuck) {
    const std::size_t n = current.shape(0);
    require(dt > 0 && longest > 0 && window > 0 && repeats > 0,
            "dt, longest, window, repeats: expected above 0");
    require(step.shape(0) == n && drift.shape(0) == n && stuck.shape(0) == n,
            "current, step, drift, stuck: expected one entry a joint");
    return {dt,
            longest,
            odd,
            speed,
            repeats,
            window,
            values(current),
            share,
            step_share,
            values(step),
            values(drift),
            {stuck.data(), stuck.data() + n}};
  }

  std::size_t n_;
  FaultCheck check_;
};

class Torques {
 public:
  Torques(In1 gain, In1 noise, double rate, In1 opposed, In1 least, In1 most)
      : n_(gain.shape(0)),
        check_(values(gain), values(noise), bounds(n_, rate, opposed, least, most)) {
    require(noise.shape(0) == n_, "noise: expected one entry a joint");
  }

  std::tuple<int, int, double> step(In1 residual, In1 current, double dt) {
    require(residual.shape(0) == n_ && current.shape(0) == n_ && dt > 0,
            "residual, current, dt: expected one entry a joint, dt above 0");
    const Verdict v = check_.step(residual.data(), current.data(), dt);
    return {static_cast<int>(v.fault), v.joint, v.value};
  }
  std::vector<double> extremes() const { return check_.extremes(); }

 private:
  static TorqueBounds bounds(std::size_t n, double rate, const In1& opposed, const In1& least,
                             const In1& most) {
    require(rate > 0 && opposed.shape(0) == n && least.shape(0) == n && most.shape(0) == n,
            "opposed, least, most: expected one entry a joint; rate: above 0");
    TorqueBounds set;
    set.rate = rate;
    set.opposed = values(opposed);
    set.least = values(least);
    set.most = values(most);
    return set;
  }

  std::size_t n_;
  TorqueCheck check_;
};

}  // namespace
}  // namespace tauguard::detectors

NB_MODULE(_faults, m) {
  using namespace tauguard::detectors;
  nb::class_<Check>(m, "Check")
      .def(nb::init<double, double, std::int64_t, double, std::int64_t, std::int64_t, double,
                    double, In1, In1, In1, Ids>())
      .def("step", &Check::step)
      .def("reset", &Check::reset);
  nb::class_<Torques>(m, "Torques")
      .def(nb::init<In1, In1, double, In1, In1, In1>())
      .def("step", &Torques::step)
      .def("extremes", &Torques::extremes);
}
