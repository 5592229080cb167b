// tauguard.detectors._observer: kinematic chains and the momentum observer on arrays, and all that
// uses them, up to the monitor of a stream. In batch functions, each row is a sample, and rows are
// independent; shapes are checked in Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "bindings.hpp"
#include "chain.hpp"
#include "observer.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::detectors;
using tauguard::geometry::load;
using tauguard::geometry::ThreadPool;

constexpr std::size_t grain = 512;  // samples per chunk

namespace {

// Rotation R (a a^T) + cos q R (1 - a a^T) + sin q R [a] about the axis a, with R = `placement`.
void fill_rotation(Joint& joint, const double* placement) {
  const double a[3] = {joint.axis.x, joint.axis.y, joint.axis.z};
  const double skew[9] = {0, -a[2], a[1], a[2], 0, -a[0], -a[1], a[0], 0};
  for (int r = 0; r < 3; ++r)
    for (int c = 0; c < 3; ++c) {
      double along = 0, turned = 0;
      for (int k = 0; k < 3; ++k) {
        along += placement[3 * r + k] * a[k] * a[c];
        turned += placement[3 * r + k] * skew[3 * k + c];
      }
      const double whole = placement[3 * r + c];
      joint.fixed.m[3 * r + c] = joint.prismatic ? whole : along;
      joint.cosine.m[3 * r + c] = joint.prismatic ? 0.0 : whole - along;
      joint.sine.m[3 * r + c] = joint.prismatic ? 0.0 : turned;
    }
  Mat3 rotation;
  std::copy(placement, placement + 9, rotation.m);
  joint.slide = rotation * joint.axis;
}

Chain make_chain(Ids parent, Ids prismatic, In3 rotation, In2 translation, In2 axis, In2 inertial,
                 In1 armature, In1 gravity) {
  const std::size_t n = parent.shape(0);
  const bool fits = prismatic.shape(0) == n && rotation.shape(0) == n && rotation.shape(1) == 3 &&
                    rotation.shape(2) == 3 && translation.shape(0) == n &&
                    translation.shape(1) == 3 && axis.shape(0) == n && axis.shape(1) == 3 &&
                    inertial.shape(0) == n && inertial.shape(1) == inertial_numbers &&
                    armature.shape(0) == n && gravity.shape(0) == 3;
  if (!fits) throw std::invalid_argument("Chain: array lengths differ");
  Chain chain;
  chain.gravity = load(gravity.data());
  chain.joints.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (parent.data()[i] < -1 || parent.data()[i] >= static_cast<std::int64_t>(i))
      throw std::invalid_argument("Chain: a joint's parent must come before it");
    Joint& joint = chain.joints[i];
    joint.parent = static_cast<int>(parent.data()[i]);
    joint.prismatic = prismatic.data()[i] != 0;
    joint.axis = load(axis.data() + 3 * i);
    joint.offset = load(translation.data() + 3 * i);
    fill_rotation(joint, rotation.data() + 9 * i);
    const double* b = inertial.data() + inertial_numbers * i;
    joint.inertial = {b[0], load(b + 1), b[4], b[5], b[6], b[7], b[8], b[9]};
    joint.armature = armature.data()[i];
  }
  return chain;
}

template <class Row>
void each_row(std::size_t rows, int joints, int threads, const Row& row) {
  nb::gil_scoped_release release;
  ThreadPool::shared().parallel_for(rows, threads, grain, [&](auto begin, auto end, auto) {
    Workspace work(joints);
    for (auto t = begin; t < end; ++t) row(t, work);
  });
}

template <class... Arrays>
void same_rows(const Chain& chain, const Arrays&... arrays) {
  const std::size_t rows = std::get<0>(std::tie(arrays...)).shape(0);
  const std::size_t n = chain.joints.size();
  require(((arrays.shape(0) == rows && arrays.shape(1) == n) && ...), "arrays differ in shape");
}

// Column-wise filter of given p, beta, tau (tau may have no rows: zero): r of shape (T, c).
void filter(In1 gain, In1 dt, In2 p, In2 beta, In2 tau, Out2 out) {
  const std::size_t rows = p.shape(0), columns = p.shape(1);
  const bool driven = tau.shape(0) > 0;
  require(beta.shape(0) == rows && beta.shape(1) == columns && out.shape(0) == rows &&
              out.shape(1) == columns && gain.shape(0) == columns && dt.shape(0) + 1 >= rows &&
              (!driven || (tau.shape(0) == rows && tau.shape(1) == columns)),
          "filter: arrays differ in shape");
  nb::gil_scoped_release release;
  std::vector<double> decay(columns);
  double decay_dt = -1.0;
  for (std::size_t c = 0; c < columns && rows > 0; ++c) out.data()[c] = 0.0;
  for (std::size_t t = 1; t < rows; ++t) {
    const double step = dt.data()[t - 1];
    if (step != decay_dt) {
      for (std::size_t c = 0; c < columns; ++c) decay[c] = observer_decay(gain.data()[c], step);
      decay_dt = step;
    }
    const std::size_t now = t * columns, before = now - columns;
    for (std::size_t c = 0; c < columns; ++c)
      out.data()[now + c] = observer_step(
          out.data()[before + c], decay[c], step, p.data()[now + c], p.data()[before + c],
          beta.data()[now + c], beta.data()[before + c], driven ? tau.data()[before + c] : 0.0);
  }
}

void bind_chain(nb::module_& m) {
  nb::class_<Chain>(m, "Chain")
      .def(
          "__init__",
          [](Chain* self, Ids parent, Ids prismatic, In3 rotation, In2 translation, In2 axis,
             In2 inertial, In1 armature, In1 gravity) {
            new (self) Chain(make_chain(parent, prismatic, rotation, translation, axis, inertial,
                                        armature, gravity));
          },
          "parent"_a, "prismatic"_a, "rotation"_a, "translation"_a, "axis"_a, "inertial"_a,
          "armature"_a, "gravity"_a)
      .def(
          "momentum",
          [](const Chain& chain, In2 q, In2 qd, Out2 p, Out2 beta, int threads) {
            same_rows(chain, q, qd, p, beta);
            const std::size_t n = chain.joints.size();
            each_row(q.shape(0), n, threads, [&](std::size_t t, Workspace& work) {
              chain.momentum(q.data() + n * t, qd.data() + n * t, p.data() + n * t,
                             beta.data() + n * t, work);
            });
          },
          "q"_a, "qd"_a, "p"_a.noconvert(), "beta"_a.noconvert(), "threads"_a)
      .def(
          "rnea",
          [](const Chain& chain, In2 q, In2 qd, In2 qdd, Out2 tau, int threads) {
            same_rows(chain, q, qd, qdd, tau);
            const std::size_t n = chain.joints.size();
            each_row(q.shape(0), n, threads, [&](std::size_t t, Workspace& work) {
              chain.rnea(q.data() + n * t, qd.data() + n * t, qdd.data() + n * t,
                         tau.data() + n * t, work);
            });
          },
          "q"_a, "qd"_a, "qdd"_a, "tau"_a.noconvert(), "threads"_a)
      .def(
          "mass_matrix",
          [](const Chain& chain, In2 q, Out3 m, int threads) {
            const std::size_t n = chain.joints.size();
            require(
                q.shape(1) == n && m.shape(0) == q.shape(0) && m.shape(1) == n && m.shape(2) == n,
                "mass_matrix: arrays differ in shape");
            each_row(q.shape(0), n, threads, [&](std::size_t t, Workspace& work) {
              chain.mass_matrix(q.data() + n * t, m.data() + n * n * t, work);
            });
          },
          "q"_a, "m"_a.noconvert(), "threads"_a)
      .def(
          "regressor",
          [](const Chain& chain, In2 q, In2 qd, Out3 p, Out3 beta, int threads) {
            const std::size_t n = chain.joints.size(), c = inertial_numbers * n;
            same_rows(chain, q, qd);
            require(p.shape(0) == q.shape(0) && p.shape(1) == n && p.shape(2) == c &&
                        beta.shape(0) == q.shape(0) && beta.shape(1) == n && beta.shape(2) == c,
                    "regressor: arrays differ in shape");
            each_row(q.shape(0), n, threads, [&](std::size_t t, Workspace& work) {
              chain.regressor(q.data() + n * t, qd.data() + n * t, p.data() + n * c * t,
                              beta.data() + n * c * t, work);
            });
          },
          "q"_a, "qd"_a, "p"_a.noconvert(), "beta"_a.noconvert(), "threads"_a)
      .def(
          "link_regressor",
          [](const Chain& chain, int link, In2 q, In2 qd, Out3 p, Out3 beta, int threads) {
            const std::size_t n = chain.joints.size(), c = p.shape(2);
            same_rows(chain, q, qd);
            require(link >= 0 && link < chain.size() && c <= inertial_numbers &&
                        p.shape(0) == q.shape(0) && p.shape(1) == n &&
                        beta.shape(0) == q.shape(0) && beta.shape(1) == n && beta.shape(2) == c,
                    "link_regressor: arrays differ in shape");
            each_row(q.shape(0), n, threads, [&](std::size_t t, Workspace& work) {
              chain.link_regressor(link, static_cast<int>(c), q.data() + n * t, qd.data() + n * t,
                                   p.data() + n * c * t, beta.data() + n * c * t, work);
            });
          },
          "link"_a, "q"_a, "qd"_a, "p"_a.noconvert(), "beta"_a.noconvert(), "threads"_a);
}

// Residuals of an observer along samples, and whether one exceeds its fixed bound. Rows of
// `numbers`: drive gain, Coulomb friction (times `direction`), viscous friction, least and largest
// position, bound of the residual. Beyond these positions, and for `hold` samples after, a joint
// touches its stop, so its residual is set to 0; `left` counts the remaining samples of each joint.
void alarms(Observer& observer, In2 q, In2 qd, In2 direction, In2 current, In2 numbers, double dt,
            std::int64_t hold, nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig> left, Out2 out,
            nb::ndarray<bool, nb::ndim<1>, nb::c_contig> up) {
  same_rows(observer.chain(), q, qd, direction, current, out);
  const std::size_t rows = q.shape(0), n = q.shape(1);
  require(
      numbers.shape(0) == 6 && numbers.shape(1) == n && left.shape(0) == n && up.shape(0) == rows,
      "alarms: arrays differ in shape");
  for (const In2* signal : {&q, &qd, &current})
    require(finite(signal->data(), rows * n), "q, qd, current: every entry must be finite");
  const double *gain = numbers.data(), *coulomb = gain + n, *viscous = coulomb + n,
               *low = viscous + n, *high = low + n, *bound = high + n;
  std::vector<double> tau(n);
  for (std::size_t t = 0, at = 0; t < rows; ++t, at += n) {
    const double *position = q.data() + at, *speed = qd.data() + at;
    for (std::size_t j = 0; j < n; ++j)
      tau[j] = gain[j] * current.data()[at + j] - coulomb[j] * direction.data()[at + j] -
               viscous[j] * speed[j];
    if (observer.started())
      observer.step(position, speed, tau.data(), dt);
    else
      observer.reset(position, speed, tau.data());
    up.data()[t] = false;
    for (std::size_t j = 0; j < n; ++j) {
      std::int64_t& waits = left.data()[j];
      const bool beyond = position[j] < low[j] || position[j] > high[j];
      waits = beyond ? hold : std::max<std::int64_t>(waits - 1, 0);
      const double residual = waits > 0 ? 0.0 : observer.residual()[j];
      out.data()[at + j] = residual;
      up.data()[t] |= std::fabs(residual) > bound[j];
    }
  }
}

void bind_observer(nb::module_& m) {
  nb::class_<Observer>(m, "Observer")
      .def(
          "__init__",
          [](Observer* self, const Chain& chain, In1 gain) {
            require(gain.shape(0) == chain.joints.size(), "gain: one entry per joint");
            new (self)
                Observer(chain, std::vector<double>(gain.data(), gain.data() + gain.shape(0)));
          },
          "chain"_a, "gain"_a)
      .def_prop_ro("started", &Observer::started)
      .def("state", &Observer::state)
      .def(
          "restore",
          [](Observer& observer, const std::vector<double>& saved) {
            require(observer.restore(saved), "state: of another arm");
          },
          "state"_a)
      .def(
          "reset",
          [](Observer& observer, In1 q, In1 qd, In1 tau) {
            check_sample(observer.chain().joints.size(), q, qd, tau, "tau");
            observer.reset(q.data(), qd.data(), tau.data());
          },
          "q"_a, "qd"_a, "tau"_a)
      .def(
          "step",
          [](Observer& observer, In1 q, In1 qd, In1 tau, double dt, Out1 out) {
            check_sample(observer.chain().joints.size(), q, qd, tau, "tau");
            require(dt > 0 && std::isfinite(dt), "dt: must be above 0");
            require(observer.started(), "step before reset");
            require(out.shape(0) == q.shape(0), "out: one entry per joint");
            const double* r = observer.step(q.data(), qd.data(), tau.data(), dt);
            std::copy(r, r + q.shape(0), out.data());
          },
          "q"_a, "qd"_a, "tau"_a, "dt"_a, "out"_a.noconvert())
      .def("alarms", &alarms, "q"_a, "qd"_a, "direction"_a, "current"_a, "numbers"_a, "dt"_a,
           "hold"_a, "left"_a.noconvert(), "out"_a.noconvert(), "up"_a.noconvert());
}

}  // namespace

NB_MODULE(_observer, m) {
  tauguard::geometry::bind_argument_errors();
  m.doc() = "Rigid-body terms, momentum observer, estimator, fault checks, monitor.";
  bind_chain(m);
  bind_observer(m);
  m.def("filter", &filter, "gain"_a, "dt"_a, "p"_a, "beta"_a, "tau"_a, "out"_a.noconvert());
  bind_estimator(m);
  bind_free_motion(m);
  bind_faults(m);
  bind_monitor(m);
}
