// Python bindings of the plant. A plant's result depends only on its own state and action, so it is
// the same for any number of threads.
#include "plant.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "bindings.hpp"
#include "tauguard/geometry/argument_errors.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/thread_pool.hpp"

using namespace tauguard::envs;
using namespace nb::literals;

namespace {

// The arrays of MuJoCo's Python objects `model` and `data`, which are kept alive.
Physics physics_of(nb::object model, nb::object data, std::uintptr_t step,
                   std::uintptr_t kinematics, std::uintptr_t distance) {
  Engine e;
  const auto address = [](const nb::object& of) {
    return nb::cast<std::uintptr_t>(of.attr("_address"));
  };
  e.model = reinterpret_cast<const void*>(address(model));
  e.data = reinterpret_cast<void*>(address(data));
  e.step = reinterpret_cast<Engine::Function>(step);
  e.kinematics = reinterpret_cast<Engine::Function>(kinematics);
  e.distance = reinterpret_cast<Engine::Distance>(distance);
  const auto array = [&](const char* name) { return nb::cast<Array>(data.attr(name)); };
  e.nq = array("qpos").size(), e.nv = array("qvel").size();
  e.qpos = array("qpos").data(), e.qvel = array("qvel").data();
  e.qfrc_applied = array("qfrc_applied").data(), e.xfrc_applied = array("xfrc_applied").data();
  e.sensordata = array("sensordata").data(), e.site_xpos = array("site_xpos").data();
  e.xpos = array("xpos").data(), e.xquat = array("xquat").data(), e.xmat = array("xmat").data();
  e.xanchor = array("xanchor").data(), e.xaxis = array("xaxis").data();
  e.mocap_pos = array("mocap_pos").data(), e.mocap_quat = array("mocap_quat").data();
  e.geom_xpos = array("geom_xpos").data(), e.geom_xmat = array("geom_xmat").data();
  e.geom_rbound = nb::cast<Array>(model.attr("geom_rbound")).data();
  e.owner = std::make_shared<nb::tuple>(nb::make_tuple(std::move(model), std::move(data)));
  return Physics(std::move(e));
}

void check(const double* action, std::size_t n, std::size_t env) {
  for (std::size_t i = 0; i < n; ++i)
    if (!std::isfinite(action[i]))
      throw std::invalid_argument("action: not finite at entry " + std::to_string(i) +
                                  " of environment " + std::to_string(env) +
                                  "; expected numbers from -1 to 1");
}

void check_action(const Plant& p, Vector action) {
  if (action.shape(0) != p.controls.scale.size())
    throw std::invalid_argument("action: wrong length");
  check(action.data(), action.shape(0), 0);
}

// While an object of this class lives, MuJoCo does not read the clock for `MjData.timer`, which
// takes a tenth of a small arm's step. Any thread can call the function that replaces the clock.
class Untimed {
 public:
  using Clock = double (*)();
  static inline Clock* clock = nullptr;  // mjcb_time

  Untimed() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (clock && users_++ == 0) before_ = std::exchange(*clock, [] { return 0.0; });
  }
  ~Untimed() {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (clock && --users_ == 0) *clock = before_;
  }
  Untimed(const Untimed&) = delete;
  Untimed& operator=(const Untimed&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int users_ = 0;
  static inline Clock before_ = nullptr;
};

void step_one(Plant& p, Vector action) {
  check_action(p, action);
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  const Untimed untimed;
  p.step(action.data());
}

// Steps every plant whose mask is not 0 with its row of the actions.
void step_all(const std::vector<Plant*>& plants, Matrix actions,
              nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu> mask,
              int threads) {
  const std::size_t n = plants.size(), width = actions.shape(1);
  if (actions.shape(0) != n || mask.shape(0) != n)
    throw std::invalid_argument("actions, mask: expected one row per plant");
  for (std::size_t i = 0; i < n; ++i) {
    if (plants[i]->controls.scale.size() != width)
      throw std::invalid_argument("actions: wrong width");
    if (mask.data()[i]) check(actions.data() + i * width, width, i);
  }
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  const Untimed untimed;
  tauguard::geometry::ThreadPool::shared().parallel_for(
      n, threads, 1, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i)
          if (mask.data()[i]) plants[i]->step(actions.data() + i * width);
      });
}

std::size_t follow(Plant& p, Matrix q_des, Matrix qd_des, Matrix tau_ff, Matrix wrench,
                   int wrench_body, Track& track) {
  const std::size_t rows = q_des.shape(0);
  for (const Matrix& m : {q_des, qd_des, tau_ff})
    if (m.shape(0) != rows || m.shape(1) != p.joints())
      throw std::invalid_argument("q_des, qd_des, tau_ff: expected one shape (rows, joints)");
  if (wrench_body > 0 && (wrench.shape(0) != rows || wrench.shape(1) != 6))
    throw std::invalid_argument("wrench: expected (rows, 6)");
  if (track.q.size() < rows * p.joints()) throw std::invalid_argument("track: too short");
  track.wrench = wrench.data();
  track.wrench_body = wrench_body;
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  const Untimed untimed;
  return p.follow({q_des.data(), qd_des.data(), tau_ff.data(), p.joints()}, rows, track);
}

// Poses of bodies and axes of joints, by kinematics alone: one row of each table per row of q. The
// columns of q belong to the addresses `qpos`.
void poses(const Physics& physics, const std::vector<int>& qpos, Matrix q,
           const std::vector<int>& bodies, const std::vector<int>& joints, Array position,
           Array rotation, Array anchor, Array axis) {
  const std::size_t rows = q.shape(0), n = qpos.size();
  if (q.shape(1) != n) throw std::invalid_argument("q: expected one column per address");
  if (position.size() != 3 * rows * bodies.size() || rotation.size() != 3 * position.size() ||
      anchor.size() != 3 * rows * joints.size() || axis.size() != anchor.size())
    throw std::invalid_argument("poses: a table has the wrong size");
  double *p = position.data(), *r = rotation.data(), *o = anchor.data(), *a = axis.data();
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t i = 0; i < n; ++i) physics.qpos()[qpos[i]] = q.data()[row * n + i];
    physics.kinematics();
    for (int body : bodies) {
      p = std::copy_n(physics.position(body), 3, p);
      r = std::copy_n(physics.rotation(body), 9, r);
    }
    for (int joint : joints) {
      o = std::copy_n(physics.anchor(joint), 3, o);
      a = std::copy_n(physics.axis(joint), 3, a);
    }
  }
}

void bind_plant(nb::module_& m) {
  nb::class_<Physics>(m, "Physics")
      .def(nb::new_(&physics_of), "model"_a, "data"_a, nb::kw_only(), "step"_a, "kinematics"_a,
           "distance"_a);
  nb::class_<Plant>(m, "Plant")
      .def(
          "__init__",
          [](Plant* self, const Physics& physics, std::vector<Joint> joints, double dt,
             double decay) {
            new (self) Plant(physics, DriveTrain{std::move(joints), {}, dt, decay});
          },
          "physics"_a, "joints"_a, nb::kw_only(), "dt"_a, "decay"_a)
      .def(
          "surround",
          [](Plant& p, const Surroundings& around, const Controls& controls, const Rows& rows,
             int substeps) {
            if (!around.people.empty() && !around.barriers.all.empty() &&
                around.people_geoms.size() != around.people.size() * person_segments)
              throw std::invalid_argument("people_geoms: expected one geom per capsule");
            p.controls = controls;
            p.controls.override_speed.assign(p.joints(), 0.0);
            p.substeps = substeps;
            p.surround(around, rows);
          },
          "around"_a, "controls"_a, "rows"_a, nb::kw_only(), "substeps"_a)
      .def(
          "carry",
          [](Plant& p, int mocap, Matrix path) {
            if (path.shape(1) != 4 || path.shape(0) < 2)
              throw std::invalid_argument("path: expected two or more rows of time and position");
            Carried c{mocap, {}};
            for (std::size_t k = 0; k < path.shape(0); ++k) {
              const double* row = path.data() + 4 * k;
              c.path.push_back({row[0], row[1], row[2], row[3]});
            }
            p.carried.push_back(std::move(c));
          },
          "mocap"_a, "path"_a)
      .def(
          "belt",
          [](Plant& p, int qpos, int dof, double speed) { p.belts.push_back({qpos, dof, speed}); },
          "qpos"_a, "dof"_a, "speed"_a)
      .def("reset", &Plant::reset)
      .def("relax", &Plant::relax)
      .def("step", &step_one, "action"_a)
      .def(
          "begin",
          [](Plant& p, Vector action) {
            check_action(p, action);
            p.begin(action.data());
          },
          "action"_a)
      .def("run", &Plant::run, "steps"_a, nb::call_guard<nb::gil_scoped_release, Untimed>())
      .def("finish", &Plant::finish)
      .def("refresh", &Plant::refresh)
      .def(
          "aim",
          [](Plant& p, Vector place, double hold) {
            if (place.shape(0) != 3) throw std::invalid_argument("place: expected three numbers");
            p.aim(load(place.data()), hold);
          },
          "place"_a, "hold"_a)
      .def(
          "override",
          [](Plant& p, int kind, Vector speed) {
            if (speed.shape(0) != p.joints())
              throw std::invalid_argument("speed: expected one number per joint");
            p.controls.override = static_cast<Override>(kind);
            p.controls.override_speed.assign(speed.data(), speed.data() + speed.shape(0));
          },
          "kind"_a, "speed"_a)
      .def("follow", &follow, "q_des"_a, "qd_des"_a, "tau_ff"_a, "wrench"_a, "wrench_body"_a,
           "track"_a)
      .def("state", &Plant::state)
      .def(
          "restore",
          [](Plant& p, const Numbers& saved) {
            if (!p.restore(saved)) throw std::invalid_argument("state: of another scene");
          },
          "state"_a);
}

}  // namespace

NB_MODULE(_plant, m) {
  tauguard::geometry::bind_argument_errors();
  m.doc() = "The plant: an arm, its drives and surroundings, stepped natively.";
  bind_values(m);
  bind_plant(m);
  m.def(
      "set_clock",
      [](std::uintptr_t address) { Untimed::clock = reinterpret_cast<Untimed::Clock*>(address); },
      "address"_a);
  m.def("step_all", &step_all, "plants"_a, "actions"_a, "mask"_a, "threads"_a);
  m.def("poses", &poses, "physics"_a, "qpos"_a, "q"_a, "bodies"_a, "joints"_a, nb::kw_only(),
        "position"_a, "rotation"_a, "anchor"_a, "axis"_a);
  m.attr("CONTACT_WIDTH") = contact_width;
  m.attr("REACH_WIDTH") = reach_width;
  m.attr("WALK_WIDTH") = walk_width;
  m.attr("PERSON_SEGMENTS") = person_segments;
  m.attr("SENSOR_WIDTH") = sensor_width;
  m.attr("METRICS") = static_cast<int>(metrics_width);
}
