// Fault checks of streams of samples, on arrays.
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <tuple>

#include "bindings.hpp"
#include "faults.hpp"
#include "torques.hpp"

namespace tauguard::detectors {
namespace {

std::vector<double> values(const In1& x) { return {x.data(), x.data() + x.shape(0)}; }

std::tuple<int, int, double> numbers(const Verdict& v) {
  return {static_cast<int>(v.fault), v.joint, v.value};
}

FaultCheck* make_check(double dt, double longest, std::int64_t odd, double speed,
                       std::int64_t repeats, std::int64_t window, double fraction,
                       double step_fraction, In1 current, In1 step, In1 drift, Ids stuck) {
  const std::size_t n = current.shape(0);
  require(dt > 0 && longest > 0 && window > 0 && repeats > 0,
          "dt, longest, window, repeats: expected above 0");
  require(step.shape(0) == n && drift.shape(0) == n && stuck.shape(0) == n,
          "current, step, drift, stuck: expected one entry per joint");
  return new FaultCheck({dt,
                         longest,
                         odd,
                         speed,
                         repeats,
                         window,
                         values(current),
                         fraction,
                         step_fraction,
                         values(step),
                         values(drift),
                         {stuck.data(), stuck.data() + n}});
}

TorqueCheck* make_torques(In1 gain, In1 noise, double rate, In1 opposed, In1 least, In1 most) {
  const std::size_t n = gain.shape(0);
  require(noise.shape(0) == n, "noise: expected one entry per joint");
  require(rate > 0 && opposed.shape(0) == n && least.shape(0) == n && most.shape(0) == n,
          "opposed, least, most: expected one entry per joint; rate: above 0");
  TorqueBounds set;
  set.rate = rate;
  set.opposed = values(opposed);
  set.least = values(least);
  set.most = values(most);
  return new TorqueCheck(values(gain), values(noise), set);
}

}  // namespace

void bind_faults(nb::module_& m) {
  nb::class_<FaultCheck>(m, "FaultCheck")
      .def(nb::new_(&make_check), "dt"_a, "longest"_a, "odd"_a, "speed"_a, "repeats"_a, "window"_a,
           "fraction"_a, "step_fraction"_a, "current"_a, "step"_a, "drift"_a, "stuck"_a)
      .def(
          "step",
          [](FaultCheck& check, double t, In1 q, In1 qd, In1 current) {
            const std::size_t n = check.joints();
            require(q.shape(0) == n && qd.shape(0) == n && current.shape(0) == n,
                    "q, qd, current: expected one entry per joint");
            return numbers(check.step(t, q.data(), qd.data(), current.data()));
          },
          "t"_a, "q"_a, "qd"_a, "current"_a)
      .def("reset", &FaultCheck::reset);
  nb::class_<TorqueCheck>(m, "TorqueCheck")
      .def(nb::new_(&make_torques), "gain"_a, "noise"_a, "rate"_a, "opposed"_a, "least"_a, "most"_a)
      .def(
          "step",
          [](TorqueCheck& check, In1 residual, In1 current, double dt) {
            const std::size_t n = check.joints();
            require(residual.shape(0) == n && current.shape(0) == n && dt > 0,
                    "residual, current, dt: expected one entry per joint, dt above 0");
            return numbers(check.step(residual.data(), current.data(), dt));
          },
          "residual"_a, "current"_a, "dt"_a)
      .def("reset", &TorqueCheck::reset)
      .def("extremes", &TorqueCheck::extremes);
}

}  // namespace tauguard::detectors
