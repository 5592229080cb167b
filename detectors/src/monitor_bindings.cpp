// Streams of scores, alarms and monitors; one call per sample.
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <memory>

#include "bindings.hpp"
#include "monitor.hpp"

namespace tauguard::detectors {
namespace {

using Numbers = std::vector<double>;
using Source = std::shared_ptr<Scores>;
using Flags = nb::ndarray<bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

// A stream that is written in Python; `make` returns a new one. Its steps allocate.
class PythonScores final : public Scores {
 public:
  PythonScores(nb::object make, std::size_t joints) : make_(std::move(make)), n_(joints) {
    PythonScores::reset();
  }
  std::size_t joints() const override { return n_; }
  void reset() override { step_ = make_().attr("step"); }
  Source clone() const override {
    auto out = std::make_shared<PythonScores>(*this);
    out->step_ = nb::module_::import_("copy").attr("deepcopy")(step_);  // and its object
    return out;
  }
  double step(const double* q, const double* qd, const double* current, double dt) override {
    return nb::cast<double>(step_(array(q), array(qd), array(current), dt));
  }

 private:
  // A copy: the stream may keep it.
  nb::object array(const double* from) const {
    return nb::cast(nb::ndarray<nb::numpy, const double, nb::ndim<1>>(from, {n_}),
                    nb::rv_policy::copy);
  }
  nb::object make_, step_;
  std::size_t n_;
};

ScaledResidual residual_of(const Estimator& estimator, const std::vector<std::int64_t>& joints,
                           const Numbers& weights, double units, double factor, bool compress) {
  Scaling scaling(joints, weights, units, factor, compress);
  require(!joints.empty() && scaling.fits(estimator.joints()),
          "scaling: expected joints of the arm, and either no weights or one per joint and term");
  return {estimator, std::move(scaling)};
}

Source limit_scores(const Estimator& estimator, const std::vector<std::int64_t>& joints,
                    const Numbers& weights, double units, double factor, bool compress,
                    const Numbers& limits) {
  require(limits.size() == joints.size(), "limits: expected one per joint that is used");
  return std::make_shared<LimitScores>(
      residual_of(estimator, joints, weights, units, factor, compress), limits);
}

Source kernel_scores(const Estimator& estimator, const std::vector<std::int64_t>& joints,
                     const Numbers& weights, double units, double factor, bool compress,
                     std::size_t lag, std::size_t count, In2 vectors, In1 coef, double intercept,
                     double sigma, bool graded, const Numbers& floor_weights,
                     const Numbers& floor_limits) {
  require(lag > 0 && count > 0 && vectors.shape(1) == joints.size() * count &&
              coef.shape(0) == vectors.shape(0) && sigma > 0,
          "kernel_scores: vectors of another size than the window, or sigma not above 0");
  Scaling plain(joints, floor_weights, 1.0, 1.0, false);
  require(plain.fits(estimator.joints()) &&
              (floor_limits.empty() || floor_limits.size() == joints.size()),
          "floor: expected six weights per joint, and one limit per joint that is used or none");
  return std::make_shared<KernelScores>(
      residual_of(estimator, joints, weights, units, factor, compress),
      Window(joints.size(), lag, count),
      KernelSum(vectors.data(), coef.data(), coef.shape(0), vectors.shape(1), intercept, sigma),
      graded, Floor{std::move(plain), floor_limits});
}

Alarm* make_alarm(Source scores, double dt, double settle, double threshold, std::int64_t samples,
                  std::int64_t memory, const Levels& levels, const Levels& floor) {
  require(scores && dt > 0 && samples > 0 && memory > 0, "dt, samples, memory: expected above 0");
  return new Alarm(std::move(scores), {dt, settle, threshold, samples, memory, levels, floor});
}

Levels* make_levels(const Numbers& speed, const Numbers& base, const Numbers& unit) {
  require(base.size() == speed.size() && unit.size() == speed.size(),
          "speed, base, unit: expected as many of each");
  return new Levels{speed, base, unit};
}

Monitor* make_monitor(const FaultCheck& check, const Alarm& alarm, const Estimator& observer,
                      const TorqueCheck& torques, double dt, double settle, double span,
                      double window, double bridged) {
  const std::size_t n = observer.joints();
  require(check.joints() == n && alarm.joints() == n && torques.joints() == n,
          "Monitor: its parts are of arms with other numbers of joints");
  require(dt > 0 && settle >= 0 && span >= 0 && window >= 0 && bridged >= 0,
          "dt: expected above 0; settle, span, window, bridged: 0 or more");
  return new Monitor(check, alarm, observer, torques, {dt, settle, span, window, bridged});
}

// State, alarm, score, fault, joint, value, settling.
nb::typed<nb::tuple, int, bool, double, int, int, double, bool> step(Monitor& monitor, double t,
                                                                     In1 q, In1 qd, In1 current) {
  const std::size_t n = monitor.joints();
  require(q.shape(0) == n && qd.shape(0) == n && current.shape(0) == n,
          "q, qd, current: expected one entry per joint");
  const Thought& said = monitor.step(t, q.data(), qd.data(), current.data());
  return nb::make_tuple(static_cast<int>(said.state), said.alarm, said.score,
                        static_cast<int>(said.why.fault), said.why.joint, said.why.value,
                        said.settling);
}

// Processes T samples: writes alarms (T,), and residuals (T, n) of another estimator. At a sample
// that is not finite, the residual is that of the sample before, initially `last`. Returns the
// first fault: number or 0, joint, value, settling.
nb::typed<nb::tuple, int, int, double, bool> steps(Monitor& monitor, In1 t, In2 q, In2 qd,
                                                   In2 current, Estimator& estimator, double dt,
                                                   Out1 last, Out2 residuals, Flags alarms) {
  const std::size_t n = monitor.joints(), rows = t.shape(0);
  for (const auto* array : {&q, &qd, &current})
    require(array->shape(0) == rows && array->shape(1) == n, "q, qd, current: another shape");
  require(estimator.joints() == n && last.shape(0) == n && residuals.shape(0) == rows &&
              residuals.shape(1) == n && alarms.shape(0) == rows,
          "estimator, last, residuals, alarms: another shape");
  std::vector<double> out((2 + motion_numbers) * n);
  Thought first;
  if (monitor.estimator()) estimator.compare(*monitor.estimator());
  for (std::size_t i = 0; i < rows; ++i) {
    const double *a = q.data() + i * n, *b = qd.data() + i * n, *c = current.data() + i * n;
    const Thought& said = monitor.step(t.data()[i], a, b, c);
    alarms.data()[i] = said.alarm;
    if (first.why.fault == Fault::none) first = said;
    if (finite(a, n) && finite(b, n) && finite(c, n)) {
      estimator.step(a, b, c, dt, out.data(), out.data() + n, out.data() + 2 * n, monitor.fed());
      std::copy_n(out.data(), n, last.data());
    }
    std::copy_n(last.data(), n, residuals.data() + i * n);
  }
  return nb::make_tuple(static_cast<int>(first.why.fault), first.why.joint, first.why.value,
                        first.settling);
}

}  // namespace

void bind_monitor(nb::module_& m) {
  nb::class_<Scores>(m, "Scores")
      .def_prop_ro("joints", &Scores::joints)
      .def(
          "step",
          [](Scores& scores, In1 q, In1 qd, In1 current, double dt) {
            check_sample(scores.joints(), q, qd, current, "current");
            require(dt > 0 && std::isfinite(dt), "dt: must be above 0");
            return scores.step(q.data(), qd.data(), current.data(), dt);
          },
          "q"_a, "qd"_a, "current"_a, "dt"_a);
  m.def(
      "free_scores",
      [](const FreeMotion& stream) -> Source { return std::make_shared<FreeScores>(stream); },
      "stream"_a);
  m.def("limit_scores", &limit_scores, "estimator"_a, "joints"_a, "weights"_a, "units"_a,
        "factor"_a, "compress"_a, "limits"_a);
  m.def("kernel_scores", &kernel_scores, "estimator"_a, "joints"_a, "weights"_a, "units"_a,
        "factor"_a, "compress"_a, "lag"_a, "count"_a, "vectors"_a, "coef"_a, "intercept"_a,
        "sigma"_a, "graded"_a, "floor_weights"_a, "floor_limits"_a);
  m.def(
      "python_scores",
      [](nb::object make, std::size_t joints) -> Source {
        return std::make_shared<PythonScores>(std::move(make), joints);
      },
      "make"_a, "joints"_a);
  nb::class_<Levels>(m, "Levels").def(nb::new_(&make_levels), "speed"_a, "base"_a, "unit"_a);
  nb::class_<Alarm>(m, "Alarm")
      .def(nb::new_(&make_alarm), "scores"_a, "dt"_a, "settle"_a, "threshold"_a, "samples"_a,
           "memory"_a, "levels"_a, "floor"_a)
      .def_prop_ro("score", &Alarm::score)
      .def("copy", &Alarm::copy)
      .def(
          "step",
          [](Alarm& alarm, In1 q, In1 qd, In1 current, double dt) {
            check_sample(alarm.joints(), q, qd, current, "current");
            require(dt > 0 && std::isfinite(dt), "dt: must be above 0");
            return alarm.step(q.data(), qd.data(), current.data(), dt);
          },
          "q"_a, "qd"_a, "current"_a, "dt"_a);
  nb::class_<Monitor>(m, "Monitor")
      .def(nb::new_(&make_monitor), "check"_a, "alarm"_a, "observer"_a, "torques"_a, "dt"_a,
           "settle"_a, "span"_a, "window"_a, "bridged"_a)
      .def_prop_ro("settled", &Monitor::settled)
      .def("copy", &Monitor::copy)
      .def("step", &step, "t"_a, "q"_a, "qd"_a, "current"_a)
      .def("steps", &steps, "t"_a, "q"_a, "qd"_a, "current"_a, "estimator"_a, "dt"_a,
           "last"_a.noconvert(), "residuals"_a.noconvert(), "alarms"_a.noconvert());
}

}  // namespace tauguard::detectors
