// The environments' kernel: control steps of one arm scene or of many, on a thread pool. A plant's
// result depends on nothing but its own state and action, so it is the same for any number of
// threads.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>

#include "plant.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/thread_pool.hpp"

namespace nb = nanobind;
using namespace tauguard::envs;

namespace {

using Words = std::map<std::string, std::uintptr_t>;
using Integers = std::map<std::string, std::vector<int>>;
using Numbers = std::map<std::string, std::vector<double>>;
using Vector = nb::ndarray<const double, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<const double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

template <typename T>
T* pointer(std::uintptr_t address) {
  return reinterpret_cast<T*>(address);
}

void bind_addresses(Plant& p, const Words& w) {
  p.at.step = reinterpret_cast<void (*)(const void*, void*)>(w.at("mj_step"));
  p.at.kinematics = reinterpret_cast<void (*)(const void*, void*)>(w.at("mj_kinematics"));
  p.at.model = pointer<void>(w.at("model"));
  p.at.data = pointer<void>(w.at("data"));
  p.at.qpos = pointer<double>(w.at("qpos"));
  p.at.qvel = pointer<double>(w.at("qvel"));
  p.at.qfrc = pointer<double>(w.at("qfrc_applied"));
  p.at.sensors = pointer<double>(w.at("sensordata"));
  p.at.site_xpos = pointer<double>(w.at("site_xpos"));
  p.at.xpos = p.chain.xpos = pointer<double>(w.at("xpos"));
  p.at.xaxis = p.chain.xaxis = pointer<double>(w.at("xaxis"));
  p.chain.xmat = pointer<double>(w.at("xmat"));
  p.chain.xanchor = pointer<double>(w.at("xanchor"));
  p.rows.observation = pointer<double>(w.at("observation"));
  p.rows.figure = pointer<double>(w.at("figure"));
  p.rows.tau_ext = pointer<double>(w.at("tau_ext"));
  p.rows.target = pointer<double>(w.at("target"));
  p.rows.q = pointer<double>(w.at("row_q"));
  p.rows.qd = pointer<double>(w.at("row_qd"));
  p.rows.current = pointer<double>(w.at("row_current"));
  p.rows.tau = pointer<double>(w.at("row_tau"));
  p.rows.contact = pointer<double>(w.at("row_contact"));
  p.rows.region = pointer<double>(w.at("row_region"));
}

void bind_layout(Plant& p, const Integers& i) {
  p.chain.joint = i.at("joint");
  p.chain.body = i.at("body");
  p.chain.first = i.at("first");
  p.chain.slide = i.at("slide");
  p.qpos = i.at("qpos_adr");
  p.dof = i.at("dof_adr");
  p.tool_site = i.at("tool_site");
  p.tool_body = i.at("tool_body");
  p.tool_first = i.at("tool_first");
  p.nq = i.at("sizes").at(0);
  p.nv = i.at("sizes").at(1);
  p.substeps = i.at("sizes").at(2);
  p.sensor_begin = i.at("sizes").at(3);
  p.controls.mode = static_cast<Mode>(i.at("sizes").at(4));
  const std::vector<int>& r = i.at("regions");  // body, joint, qpos, dof, sensor
  for (std::size_t k = 0; k + 4 < r.size(); k += 5) {
    Region region;
    region.body = r[k], region.joint = r[k + 1], region.qpos = r[k + 2], region.dof = r[k + 3];
    region.sensor = r[k + 4];
    p.regions.push_back(region);
  }
}

void bind_numbers(Plant& p, const Numbers& x) {
  p.chain.mass = x.at("mass");
  p.chain.com = x.at("com");
  const std::vector<double>& g = x.at("gravity");
  p.chain.gravity = {g.at(0), g.at(1), g.at(2)};
  p.dt = x.at("times").at(0);
  p.decay = x.at("times").at(1);
  p.controls.period = p.dt * p.substeps;
  p.controls.scale = x.at("scale");
  p.controls.centre = x.at("centre");
  p.controls.max_speed = x.at("max_speed");
  p.controls.torque_limit = x.at("torque_limit");
  p.controls.override_speed.assign(p.qpos.size(), 0.0);
  p.low = x.at("low");
  p.high = x.at("high");
  const std::vector<double>& r =
      x.at("regions");  // quasi-static, transient [N]; span [m]; speed [m/s]
  for (std::size_t k = 0; k < p.regions.size(); ++k) {
    p.regions[k].quasi_static = r.at(4 * k), p.regions[k].transient = r.at(4 * k + 1);
    p.regions[k].span = r.at(4 * k + 2), p.regions[k].speed = r.at(4 * k + 3);
  }
}

void check(const double* action, std::size_t n, std::size_t env) {
  for (std::size_t i = 0; i < n; ++i)
    if (!std::isfinite(action[i]))
      throw nb::value_error(("action: not finite at entry " + std::to_string(i) +
                             " of environment " + std::to_string(env) +
                             "; expected numbers from -1 to 1")
                                .c_str());
}

void step_one(Plant& p, Vector action) {
  if (action.shape(0) != p.controls.scale.size()) throw nb::value_error("action: wrong length");
  check(action.data(), action.shape(0), 0);
  nb::gil_scoped_release release;
  const tauguard::geometry::RoundToNearest guard;
  p.step(action.data());
}

// Steps every plant whose mask is not 0 with its row of the actions.
void step_all(const std::vector<Plant*>& plants, Table actions,
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
  tauguard::geometry::ThreadPool::shared().parallel_for(
      n, threads, 1, [&](std::size_t begin, std::size_t end, std::size_t) {
        for (std::size_t i = begin; i < end; ++i)
          if (mask.data()[i]) plants[i]->step(actions.data() + i * width);
      });
}

}  // namespace

NB_MODULE(_env, m) {
  nb::class_<Plant>(m, "Plant")
      .def(
          "__init__",
          [](Plant* self, const Words& addresses, const Integers& layout, const Numbers& numbers,
             const std::vector<Numbers>& drive) {
            new (self) Plant();
            bind_layout(*self, layout);
            bind_addresses(*self, addresses);
            bind_numbers(*self, numbers);
            for (const Numbers& d : drive) {
              const auto one = [&](const char* name) { return d.at(name).at(0); };
              self->joints.push_back(
                  Joint{one("gain"), one("nominal_gain"), one("limit"), one("gear"), one("coulomb"),
                        one("breakaway"), one("stribeck_velocity"), one("viscous"),
                        one("bristle_stiffness"), one("load"), one("kp"), one("kd"), d.at("cycles"),
                        d.at("amplitude"), d.at("phase")});
            }
            self->states.resize(self->joints.size());
          },
          nb::arg("addresses"), nb::arg("layout"), nb::arg("numbers"), nb::arg("drive"))
      .def("reset", &Plant::reset)
      .def("step", &step_one, nb::arg("action"))
      .def(
          "begin",
          [](Plant& p, Vector action) {
            if (action.shape(0) != p.controls.scale.size())
              throw nb::value_error("action: wrong length");
            check(action.data(), action.shape(0), 0);
            p.begin(action.data());
          },
          nb::arg("action"))
      .def("run", &Plant::run, nb::arg("steps"), nb::call_guard<nb::gil_scoped_release>())
      .def("finish", &Plant::finish)
      .def("refresh", &Plant::refresh)
      .def(
          "override",
          [](Plant& p, int kind, Vector speed) {
            if (speed.shape(0) != p.qpos.size()) throw nb::value_error("speed: one number a joint");
            p.controls.override = static_cast<Override>(kind);
            p.controls.override_speed.assign(speed.data(), speed.data() + speed.shape(0));
          },
          nb::arg("kind"), nb::arg("speed"));
  m.def("step_all", &step_all, nb::arg("plants"), nb::arg("actions"), nb::arg("mask"),
        nb::arg("threads"));
  m.attr("CONTACT_WIDTH") = contact_width;
  m.attr("FIGURES") = static_cast<int>(figures);
}
