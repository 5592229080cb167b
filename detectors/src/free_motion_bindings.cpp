// Python bindings of the free-motion detector, which take the samples of a whole log as arrays.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include "bindings.hpp"
#include "free_motion.hpp"

namespace tauguard::detectors {

namespace {

using Numbers = std::vector<double>;

FreeMotion* make(const Estimator& estimator, const Numbers& rest, const Numbers& stop,
                 const Numbers& least, const Numbers& moving, const Numbers& start,
                 const Numbers& turned, const Numbers& fast, const Numbers& hard,
                 const Numbers& beyond, const Numbers& low, const Numbers& high) {
  const std::size_t n = estimator.joints();
  require(n > 0 && rest.size() == n && stop.size() == n && least.size() == n && start.size() == n &&
              turned.size() == n && fast.size() == n && hard.size() == n && beyond.size() == n &&
              low.size() == n && high.size() == n && moving.size() == RegimeBounds::terms * n,
          "FreeMotion: array lengths differ");
  return new FreeMotion(estimator,
                        {rest, stop, least, moving, start, turned, fast, hard, beyond, low, high});
}

void copy(const std::vector<double>& from, double* to) { std::copy(from.begin(), from.end(), to); }

void run(FreeMotion& stream, In1 dt, In2 q, In2 qd, In2 current, Out2 ratio, Out2 bound,
         Out2 residual, Out2 qdd, Out2 shaken, Out2 around, Out2 rest, Out2 hides) {
  const std::size_t rows = q.shape(0), n = stream.joints();
  for (const auto& a : {q, qd, current})
    require(a.shape(0) == rows && a.shape(1) == n, "run: arrays differ in shape");
  for (const auto& a : {ratio, bound, residual, qdd, shaken, around, rest, hides})
    require(a.shape(0) == rows && a.shape(1) == n, "run: arrays differ in shape");
  require(dt.shape(0) == rows, "run: dt must have one interval per row of q");
  nb::gil_scoped_release release;
  stream.reset();
  for (std::size_t t = 0; t < rows; ++t) {
    const std::size_t at = n * t;
    stream.step(q.data() + at, qd.data() + at, current.data() + at, dt.data()[t]);
    copy(stream.ratio(), ratio.data() + at);
    copy(stream.bound(), bound.data() + at);
    copy(stream.residual(), residual.data() + at);
    copy(stream.qdd(), qdd.data() + at);
    for (std::size_t j = 0; j < n; ++j) {
      shaken.data()[at + j] = stream.regimes().shaken(j);
      around.data()[at + j] = stream.regimes().around(j);
      rest.data()[at + j] = stream.regimes().rest(j);
      hides.data()[at + j] = stream.regimes().hides(j);
    }
  }
}

}  // namespace

void bind_free_motion(nb::module_& m) {
  nb::class_<FreeMotion>(m, "FreeMotion")
      .def(nb::new_(&make), "estimator"_a, "rest"_a, "stop"_a, "least"_a, "moving"_a, "start"_a,
           "turned"_a, "fast"_a, "hard"_a, "beyond"_a, "low"_a, "high"_a)
      .def("run", &run, "dt"_a, "q"_a, "qd"_a, "current"_a, "ratio"_a.noconvert(),
           "bound"_a.noconvert(), "residual"_a.noconvert(), "qdd"_a.noconvert(),
           "shaken"_a.noconvert(), "around"_a.noconvert(), "rest"_a.noconvert(),
           "hides"_a.noconvert());
  m.attr("REGIME_SLOW") = slow;
  m.attr("REGIME_CREEP") = Regimes::creep;
  m.attr("REGIME_SETTLES") = Regimes::settles;
  m.attr("HIDES_BY_MOTION") = int(Regimes::by_motion);
  m.attr("HIDES_BY_PLACE") = int(Regimes::by_place);
  m.attr("REGIME_HARDER") = Regimes::harder;
}

}  // namespace tauguard::detectors
