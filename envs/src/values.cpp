// Python bindings of the structs that a plant is built from; headers describe their members.
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "plant.hpp"

namespace tauguard::envs {
namespace {

using namespace nb::literals;

void bind_joint(nb::module_& m) {
  nb::class_<Joint>(m, "Joint")
      .def(
          "__init__",
          [](Joint* self, const nb::kwargs& given) {
            Joint joint;
            std::string known;
            std::size_t count = 0;
            for_each_value(joint, [&](const char* name, auto& value) {
              if (!given.contains(name))
                throw nb::type_error((std::string("Joint: missing keyword ") + name).c_str());
              value = nb::cast<std::decay_t<decltype(value)>>(given[name]);
              known += std::string(" ") + name;
              ++count;
            });
            if (given.size() != count)
              throw nb::type_error(("Joint: unknown keyword; known are" + known).c_str());
            new (self) Joint(std::move(joint));
          },
          nb::sig("def __init__(self, **kwargs: object) -> None"));
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
             double least_pressure, double stiffness) {
            new (self)
                Region{body,         joint,     qpos, dof,   mocap, held,           sensor,
                       quasi_static, transient, span, speed, area,  least_pressure, stiffness};
          },
          nb::kw_only(), "body"_a, "joint"_a, "qpos"_a, "dof"_a, "mocap"_a, "held"_a, "sensor"_a,
          "quasi_static"_a, "transient"_a, "span"_a, "speed"_a, "area"_a, "least_pressure"_a,
          "stiffness"_a);
  nb::class_<Surroundings>(m, "Surroundings")
      .def(
          "__init__",
          [](Surroundings* self, std::vector<Link> links, Numbers gravity, std::vector<Tool> tools,
             std::vector<Region> regions, int people_begin, const std::vector<Anatomy>& people,
             int sensor_begin, int arms_sensor, Numbers low, Numbers high,
             std::vector<int> people_geoms, const std::vector<int>& barriers, Matrix boxes) {
            if (gravity.size() != 3) throw nb::value_error("gravity: expected three numbers");
            const bool each = people.empty() || barriers.empty() ||
                              people_geoms.size() == people.size() * person_segments;
            if (!each || boxes.shape(0) != barriers.size() || boxes.shape(1) != 6)
              throw nb::value_error(
                  "people_geoms, barriers: expected one geom per capsule, one box per barrier");
            Barriers about;
            for (std::size_t k = 0; k < barriers.size(); ++k)
              about.all.push_back(
                  {barriers[k], load(boxes.data() + 6 * k), load(boxes.data() + 6 * k + 3)});
            new (self) Surroundings{
                Kinematics{nullptr, std::move(links), Vec3{gravity[0], gravity[1], gravity[2]}},
                std::move(tools),
                std::move(regions),
                people_begin,
                std::vector<Person>(people.begin(), people.end()),
                std::move(low),
                std::move(high),
                sensor_begin,
                arms_sensor,
                std::move(people_geoms),
                std::move(about)};
          },
          nb::kw_only(), "links"_a, "gravity"_a, "tools"_a, "regions"_a, "people_begin"_a,
          "people"_a, "sensor_begin"_a, "arms_sensor"_a, "low"_a, "high"_a, "people_geoms"_a,
          "barriers"_a, "boxes"_a);
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

}  // namespace

void bind_values(nb::module_& m) {
  bind_joint(m);
  bind_anatomy(m);
  bind_surroundings(m);
  bind_outputs(m);
}

}  // namespace tauguard::envs
