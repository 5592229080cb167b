// Python's view of the plant. A plant's result depends on nothing but its own state and action, so
// it is the same for any number of threads.
#include "plant.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <utility>

#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace tauguard::envs;

namespace {

using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Matrix = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Numbers = std::vector<double>;
// An array that Python made and the plant reads or writes.
using Array = nb::ndarray<double, nb::c_contig, nb::device::cpu>;

// The same for the plant, which keeps the array alive.
Held held(const Array& array) {
  Held out(array.data(), {}, std::make_shared<Array>(array));
  for (std::size_t k = 0; k < array.ndim(); ++k) out.add_axis(array.shape(k));
  return out;
}

// The arrays that MuJoCo's Python binding shows; model and data are kept alive.
Physics physics_of(nb::object model, nb::object data, std::uintptr_t step,
                   std::uintptr_t kinematics) {
  Engine e;
  const auto address = [](const nb::object& of) {
    return nb::cast<std::uintptr_t>(of.attr("_address"));
  };
  e.model = reinterpret_cast<const void*>(address(model));
  e.data = reinterpret_cast<void*>(address(data));
  e.step = reinterpret_cast<Engine::Function>(step);
  e.kinematics = reinterpret_cast<Engine::Function>(kinematics);
  const auto array = [&](const char* name) { return nb::cast<Array>(data.attr(name)); };
  e.nq = array("qpos").size(), e.nv = array("qvel").size();
  e.qpos = array("qpos").data(), e.qvel = array("qvel").data();
  e.qfrc_applied = array("qfrc_applied").data(), e.xfrc_applied = array("xfrc_applied").data();
  e.sensordata = array("sensordata").data(), e.site_xpos = array("site_xpos").data();
  e.xpos = array("xpos").data(), e.xquat = array("xquat").data(), e.xmat = array("xmat").data();
  e.xanchor = array("xanchor").data(), e.xaxis = array("xaxis").data();
  e.mocap_pos = array("mocap_pos").data(), e.mocap_quat = array("mocap_quat").data();
  e.owner = std::make_shared<nb::tuple>(nb::make_tuple(std::move(model), std::move(data)));
  return Physics(std::move(e));
}

void check(const double* action, std::size_t n, std::size_t env) {
  for (std::size_t i = 0; i < n; ++i)
    if (!std::isfinite(action[i]))
      throw nb::value_error(("action: not finite at entry " + std::to_string(i) +
                             " of environment " + std::to_string(env) +
                             "; expected numbers from -1 to 1")
                                .c_str());
}

void check_action(const Plant& p, Vector action) {
  if (action.shape(0) != p.controls.scale.size()) throw nb::value_error("action: wrong length");
  check(action.data(), action.shape(0), 0);
}

// While one lives, MuJoCo does not read the clock for `MjData.timer`: a tenth of a small arm's
// step. The function that it calls instead may be called by anybody, at any time.
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
    throw nb::value_error("actions, mask: a row a plant");
  for (std::size_t i = 0; i < n; ++i) {
    if (plants[i]->controls.scale.size() != width) throw nb::value_error("actions: wrong width");
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
      throw nb::value_error("q_des, qd_des, tau_ff: expected one shape (rows, joints)");
  if (wrench_body > 0 && (wrench.shape(0) != rows || wrench.shape(1) != 6))
    throw nb::value_error("wrench: expected (rows, 6)");
  if (track.q.size() < rows * p.joints()) throw nb::value_error("track: too short");
  track.wrench = wrench.data();
  track.wrench_body = wrench_body;
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  const Untimed untimed;
  return p.follow({q_des.data(), qd_des.data(), tau_ff.data(), p.joints()}, rows, track);
}

// Where bodies and joints are along joint positions, without dynamics: a row of each table a row of
// q, whose columns go to the addresses `qpos`.
void poses(const Physics& physics, const std::vector<int>& qpos, Matrix q,
           const std::vector<int>& bodies, const std::vector<int>& joints, Array position,
           Array rotation, Array anchor, Array axis) {
  const std::size_t rows = q.shape(0), n = qpos.size();
  if (q.shape(1) != n) throw nb::value_error("q: expected a column an address");
  if (position.size() != 3 * rows * bodies.size() || rotation.size() != 3 * position.size() ||
      anchor.size() != 3 * rows * joints.size() || axis.size() != anchor.size())
    throw nb::value_error("poses: tables of other sizes than asked for");
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

void bind_joint(nb::module_& m) {
  nb::class_<Joint>(m, "Joint")
      .def(
          "__init__",
          [](Joint* self, int qpos, int dof, double gain, double nominal_gain, double current_limit,
             double gear, double coulomb, double breakaway, double stribeck_velocity,
             double viscous, double bristle_stiffness, double load, double kp, double kd,
             double rated_speed, double no_load_speed, double known_coulomb, double known_viscous,
             Numbers cycles, Numbers amplitude, Numbers phase, Numbers slope,
             Numbers slope_velocity) {
            *new (self) Joint() = {qpos,
                                   dof,
                                   gain,
                                   nominal_gain,
                                   current_limit,
                                   gear,
                                   coulomb,
                                   breakaway,
                                   stribeck_velocity,
                                   viscous,
                                   bristle_stiffness,
                                   load,
                                   kp,
                                   kd,
                                   rated_speed,
                                   no_load_speed,
                                   known_coulomb,
                                   known_viscous,
                                   std::move(cycles),
                                   std::move(amplitude),
                                   std::move(phase),
                                   std::move(slope),
                                   std::move(slope_velocity)};
          },
          nb::kw_only(), "qpos"_a, "dof"_a, "gain"_a, "nominal_gain"_a, "current_limit"_a, "gear"_a,
          "coulomb"_a, "breakaway"_a, "stribeck_velocity"_a, "viscous"_a, "bristle_stiffness"_a,
          "load"_a, "kp"_a, "kd"_a, "rated_speed"_a, "no_load_speed"_a, "known_coulomb"_a,
          "known_viscous"_a, "cycles"_a, "amplitude"_a, "phase"_a, "slope"_a = Numbers(),
          "slope_velocity"_a = Numbers());
}

void bind_anatomy(nb::module_& m) {
  nb::class_<Anatomy>(m, "Anatomy")
      .def(
          "__init__",
          [](Anatomy* self, double hip_height, double trunk, double shoulder, double hip_half,
             double neck, double head, double upper_arm, double lower_arm, double hand, double grip,
             double thigh, double shank, double floor, double facing, double hand_speed,
             double walk_speed, double reaction_time, double step_back, bool seated, bool hanging,
             bool reacts) {
            new (self) Anatomy{
                hip_height, trunk,      shoulder,      hip_half,  neck,   head,    upper_arm,
                lower_arm,  hand,       grip,          thigh,     shank,  floor,   facing,
                hand_speed, walk_speed, reaction_time, step_back, seated, hanging, reacts};
          },
          nb::kw_only(), "hip_height"_a, "trunk"_a, "shoulder"_a, "hip_half"_a, "neck"_a, "head"_a,
          "upper_arm"_a, "lower_arm"_a, "hand"_a, "grip"_a, "thigh"_a, "shank"_a, "floor"_a,
          "facing"_a, "hand_speed"_a, "walk_speed"_a, "reaction_time"_a, "step_back"_a, "seated"_a,
          "hanging"_a, "reacts"_a)
      .def(nb::init<>());
}

void bind_surroundings(nb::module_& m) {
  nb::class_<Link>(m, "Link").def(
      "__init__",
      [](Link* self, int joint, int body, int first, bool slide, double mass, Numbers com) {
        if (com.size() != 3) throw nb::value_error("com: expected three numbers");
        new (self) Link{joint, body, first, slide, mass, Vec3{com[0], com[1], com[2]}};
      },
      nb::kw_only(), "joint"_a, "body"_a, "first"_a, "slide"_a, "mass"_a, "com"_a);
  nb::class_<Tool>(m, "Tool").def(
      "__init__",
      [](Tool* self, int site, int body, int first) { new (self) Tool{site, body, first}; },
      nb::kw_only(), "site"_a, "body"_a, "first"_a);
  nb::class_<Region>(m, "Region")
      .def(
          "__init__",
          [](Region* self, int body, int joint, int qpos, int dof, int mocap, bool held, int sensor,
             double quasi_static, double transient, double span, double speed, double area,
             double least_pressure) {
            new (self) Region{body,         joint,     qpos, dof,   mocap, held,          sensor,
                              quasi_static, transient, span, speed, area,  least_pressure};
          },
          nb::kw_only(), "body"_a, "joint"_a, "qpos"_a, "dof"_a, "mocap"_a, "held"_a, "sensor"_a,
          "quasi_static"_a, "transient"_a, "span"_a, "speed"_a, "area"_a, "least_pressure"_a);
  nb::class_<Surroundings>(m, "Surroundings")
      .def(
          "__init__",
          [](Surroundings* self, std::vector<Link> links, Numbers gravity, std::vector<Tool> tools,
             std::vector<Region> regions, int people_begin, const std::vector<Anatomy>& people,
             int sensor_begin, int arms_sensor, Numbers low, Numbers high) {
            if (gravity.size() != 3) throw nb::value_error("gravity: expected three numbers");
            new (self) Surroundings{
                Kinematics{nullptr, std::move(links), Vec3{gravity[0], gravity[1], gravity[2]}},
                std::move(tools),
                std::move(regions),
                people_begin,
                std::vector<Person>(people.begin(), people.end()),
                std::move(low),
                std::move(high),
                sensor_begin,
                arms_sensor};
          },
          nb::kw_only(), "links"_a, "gravity"_a, "tools"_a, "regions"_a, "people_begin"_a,
          "people"_a, "sensor_begin"_a, "arms_sensor"_a, "low"_a, "high"_a);
}

void bind_outputs(nb::module_& m) {
  nb::class_<Rows>(m, "Rows").def(
      "__init__",
      [](Rows* self, Array observation, Array metrics, Array tau_ext, Array target, Array q,
         Array qd, Array current, Array tau, Array contact, Array region, Array tau_peak,
         Array region_force, Array region_pressure, Array region_point, Array region_direction,
         Array reaches, Array walks) {
        const Touched touched{held(region_force), held(region_pressure), held(region_point),
                              held(region_direction)};
        new (self)
            Rows{held(observation), held(metrics), held(tau_ext), held(target),  held(q),
                 held(qd),          held(current), held(tau),     held(contact), held(region),
                 held(tau_peak),    touched,       held(reaches), held(walks)};
      },
      nb::kw_only(), "observation"_a, "metrics"_a, "tau_ext"_a, "target"_a, "q"_a, "qd"_a,
      "current"_a, "tau"_a, "contact"_a, "region"_a, "tau_peak"_a, "region_force"_a,
      "region_pressure"_a, "region_point"_a, "region_direction"_a, "reaches"_a, "walks"_a);
  nb::class_<Track>(m, "Track")
      .def(
          "__init__",
          [](Track* self, Array q, Array qd, Array current, Array sensors, Array poses,
             std::vector<int> bodies, int sensor_begin) {
            new (self) Track{held(q),     held(qd),          held(current), held(sensors),
                             held(poses), std::move(bodies), sensor_begin};
          },
          nb::kw_only(), "q"_a, "qd"_a, "current"_a, "sensors"_a, "poses"_a, "bodies"_a,
          "sensor_begin"_a);
  nb::class_<Controls>(m, "Controls")
      .def(
          "__init__",
          [](Controls* self, int mode, double period, Numbers scale, Numbers centre,
             Numbers max_speed, Numbers torque_limit, Numbers low, Numbers high, double moving,
             double driven) {
            new (self) Controls();
            self->moving = moving;
            self->driven = driven;
            self->low = std::move(low);
            self->high = std::move(high);
            self->mode = static_cast<Mode>(mode);
            self->period = period;
            self->scale = std::move(scale);
            self->centre = std::move(centre);
            self->override_speed.assign(max_speed.size(), 0.0);
            self->max_speed = std::move(max_speed);
            self->torque_limit = std::move(torque_limit);
          },
          nb::kw_only(), "mode"_a, "period"_a, "scale"_a, "centre"_a, "max_speed"_a,
          "torque_limit"_a, "low"_a, "high"_a, "moving"_a, "driven"_a);
}

void bind_plant(nb::module_& m) {
  nb::class_<Physics>(m, "Physics")
      .def(nb::new_(&physics_of), "model"_a, "data"_a, nb::kw_only(), "step"_a, "kinematics"_a);
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
            p.controls = controls;
            p.substeps = substeps;
            p.surround(around, rows);
          },
          "around"_a, "controls"_a, "rows"_a, nb::kw_only(), "substeps"_a)
      .def(
          "carry",
          [](Plant& p, int mocap, Matrix path) {
            if (path.shape(1) != 4 || path.shape(0) < 2)
              throw nb::value_error("path: expected two or more rows of time and position");
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
            if (place.shape(0) != 3) throw nb::value_error("place: expected three numbers");
            p.aim(load(place.data()), hold);
          },
          "place"_a, "hold"_a)
      .def(
          "override",
          [](Plant& p, int kind, Vector speed) {
            if (speed.shape(0) != p.joints()) throw nb::value_error("speed: one number a joint");
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
            if (!p.restore(saved)) throw nb::value_error("state: of another scene");
          },
          "state"_a);
}

}  // namespace

NB_MODULE(_plant, m) {
  m.doc() = "The plant: an arm, its drives and surroundings, stepped natively.";
  bind_joint(m);
  bind_anatomy(m);
  bind_surroundings(m);
  bind_outputs(m);
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
