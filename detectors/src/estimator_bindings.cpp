// The estimator and the friction columns on arrays; shapes are checked in Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>

#include "bindings.hpp"
#include "estimator.hpp"

namespace tauguard::detectors {

namespace {

using Numbers = std::vector<double>;

FrictionBasis make_basis(const Numbers& bristles, const Numbers& stops, const Numbers& stribeck,
                         const Numbers& slopes, const Numbers& loaded, bool saturation,
                         bool modelled, const Numbers& cycles, double play, std::size_t joints) {
  require(
      bristles.size() + stops.size() > 0 && joints > 0 && cycles.size() % joints == 0 && play >= 0,
      "friction: no bristle and no stop, cycles not per joint, or play below 0");
  FrictionBasis basis;
  basis.bristles = bristles;
  basis.play = play;
  basis.stops = stops;
  basis.stribeck = stribeck;
  basis.slopes = slopes;
  basis.loaded = loaded;
  basis.saturation = saturation;
  basis.modelled = modelled;
  basis.cycles = cycles;
  basis.ripples = cycles.size() / joints;
  return basis;
}

// Friction columns of each joint, (T, n, c).
void friction_columns(const FrictionBasis& basis, In2 q, In2 qd, In2 tau, In2 load, Out3 out) {
  const std::size_t rows = q.shape(0), n = q.shape(1), c = basis.columns();
  require(qd.shape(0) == rows && qd.shape(1) == n && tau.shape(0) == rows && tau.shape(1) == n &&
              load.shape(0) == rows && load.shape(1) == n && out.shape(0) == rows &&
              out.shape(1) == n && out.shape(2) == c && basis.cycles.size() == n * basis.ripples,
          "friction_columns: arrays differ in shape");
  nb::gil_scoped_release release;
  Numbers memory(basis.memory());
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t t = 0; t < rows; ++t) {
      const std::size_t at = t * n + j;
      if (t == 0) basis.reset(q.data()[at], memory.data());
      basis.evaluate(j, q.data()[at], qd.data()[at], tau.data()[at], load.data()[at], memory.data(),
                     out.data() + at * c);
    }
}

void run(Estimator& estimator, In1 dt, In2 q, In2 qd, In2 current, Out2 residual, Out2 unexplained,
         Out3 motion, Out2 plain, Out2 theta) {
  const std::size_t rows = q.shape(0), n = estimator.joints(), m = estimator.unknowns();
  for (const auto& a : {q, qd, current})
    require(a.shape(0) == rows && a.shape(1) == n, "run: arrays differ in shape");
  require(motion.shape(0) == rows && motion.shape(1) == motion_numbers && motion.shape(2) == n,
          "run: arrays differ in shape");
  for (const auto& a : {residual, unexplained, plain})
    require(a.shape(0) == rows && a.shape(1) == n, "run: arrays differ in shape");
  const bool wanted = theta.shape(0) > 0;
  require(dt.shape(0) + 1 >= rows && (!wanted || (theta.shape(0) == rows && theta.shape(1) == m)),
          "run: arrays differ in shape");
  nb::gil_scoped_release release;
  estimator.reset();
  for (std::size_t t = 0; t < rows; ++t) {
    const double step = t ? dt.data()[t - 1] : 0.0;
    estimator.step(q.data() + n * t, qd.data() + n * t, current.data() + n * t, step,
                   residual.data() + n * t, unexplained.data() + n * t,
                   motion.data() + motion_numbers * n * t);
    std::copy(estimator.plain().begin(), estimator.plain().end(), plain.data() + n * t);
    if (wanted) std::copy(estimator.theta().begin(), estimator.theta().end(), theta.data() + m * t);
  }
}

}  // namespace

void bind_estimator(nb::module_& m) {
  nb::class_<FrictionBasis>(m, "FrictionBasis")
      .def(
          "__init__",
          [](FrictionBasis* self, const Numbers& bristles, const Numbers& stops,
             const Numbers& stribeck, const Numbers& slopes, const Numbers& loaded, bool saturation,
             bool modelled, const Numbers& cycles, double play, std::size_t joints) {
            new (self) FrictionBasis(make_basis(bristles, stops, stribeck, slopes, loaded,
                                                saturation, modelled, cycles, play, joints));
          },
          "bristles"_a, "stops"_a, "stribeck"_a, "slopes"_a, "loaded"_a, "saturation"_a,
          "modelled"_a, "cycles"_a, "play"_a, "joints"_a)
      .def_prop_ro("columns", &FrictionBasis::columns)
      .def("evaluate", &friction_columns, "q"_a, "qd"_a, "tau"_a, "load"_a, "out"_a.noconvert());
  nb::class_<Estimator>(m, "Estimator")
      .def(
          "__init__",
          [](Estimator* self, const Chain& chain, const FrictionBasis& basis,
             const Numbers& drive_gain, const Numbers& gain, const Numbers& weights,
             const Numbers& deviation, const Numbers& persistence, const Numbers& noise,
             double clip, double every, double inflation, double transition, double started,
             bool weighted, const Numbers& fusion, double plain_gain, bool sampled) {
            const std::size_t n = chain.joints.size(), unknown = payload_numbers + per_joint * n;
            require(drive_gain.size() == n && gain.size() == n && noise.size() == n &&
                        weights.size() == n * basis.columns() && deviation.size() == unknown &&
                        persistence.size() == unknown && basis.cycles.size() == n * basis.ripples &&
                        (fusion.empty() || fusion.size() == n * VelocityFusion::gain_numbers),
                    "Estimator: array lengths differ");
            new (self)
                Estimator(chain, basis,
                          {drive_gain, gain, weights, deviation, persistence, noise, clip, every,
                           inflation, transition, started, weighted, fusion, plain_gain, sampled});
          },
          "chain"_a, "basis"_a, "drive_gain"_a, "gain"_a, "weights"_a, "deviation"_a,
          "persistence"_a, "noise"_a, "clip"_a, "every"_a, "inflation"_a, "transition"_a,
          "started"_a, "weighted"_a, "fusion"_a, "plain_gain"_a, "sampled"_a)
      .def_prop_ro("started", &Estimator::started)
      .def("reset", &Estimator::reset)
      .def("copy", [](const Estimator& estimator) { return Estimator(estimator); })
      .def("run", &run, "dt"_a, "q"_a, "qd"_a, "current"_a, "residual"_a.noconvert(),
           "unexplained"_a.noconvert(), "motion"_a.noconvert(), "plain"_a.noconvert(),
           "theta"_a.noconvert())
      .def(
          "step",
          [](Estimator& estimator, In1 q, In1 qd, In1 current, double dt, Out1 residual,
             Out1 unexplained, Out2 motion) {
            check_sample(estimator.joints(), q, qd, current, "current");
            const std::size_t n = estimator.joints();
            require(residual.shape(0) == n && unexplained.shape(0) == n &&
                        motion.shape(0) == motion_numbers && motion.shape(1) == n,
                    "outputs: one entry per joint");
            require(!estimator.started() || (dt > 0 && std::isfinite(dt)), "dt: must be above 0");
            estimator.step(q.data(), qd.data(), current.data(), dt, residual.data(),
                           unexplained.data(), motion.data());
          },
          "q"_a, "qd"_a, "current"_a, "dt"_a, "residual"_a.noconvert(), "unexplained"_a.noconvert(),
          "motion"_a.noconvert());
}

}  // namespace tauguard::detectors
