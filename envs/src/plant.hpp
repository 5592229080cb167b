// One environment's physics: an action in, control steps of several mj_step each, an observation
// row and a row of figures out. MuJoCo is reached by addresses alone, as in loop.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <vector>

#include "chain.hpp"
#include "control.hpp"
#include "drive.hpp"
#include "regions.hpp"

namespace tauguard::envs {

// Columns of the row of figures.
enum Figure {
  time_now,
  distance,
  force,
  cost,
  ratio,
  region_force,
  onset,
  onset_time,
  link,
  region,
  diverged,
  speed_ratio,
  figures
};

struct Addresses {
  void (*step)(const void*, void*) = nullptr;
  void (*kinematics)(const void*, void*) = nullptr;
  const void* model = nullptr;
  void* data = nullptr;
  double *qpos = nullptr, *qvel = nullptr, *qfrc = nullptr;
  const double *sensors = nullptr, *site_xpos = nullptr, *xpos = nullptr, *xaxis = nullptr;
};

// Where results go: rows of arrays that Python owns.
struct Rows {
  double *observation = nullptr, *figure = nullptr, *tau_ext = nullptr, *target = nullptr;
  double *q = nullptr, *qd = nullptr, *current = nullptr, *tau = nullptr;  // substeps x joints
  double *contact = nullptr, *region = nullptr;  // substeps x contact_width, substeps x regions x 3
};

class Plant {
 public:
  Addresses at;
  Rows rows;
  Chain chain;
  Controls controls;
  std::vector<Joint> joints;
  std::vector<JointState> states;
  std::vector<int> qpos, dof;                         // addresses of the arm's joints
  std::vector<int> tool_site, tool_body, tool_first;  // a tool an arm; site -1: the body's origin
  std::vector<Region> regions;
  std::vector<double> low, high;  // of the observation
  int sensor_begin = -1;          // of the links' contact sensors; -1: none
  int nq = 0, nv = 0;
  double dt = 1e-3, decay = 0.0;
  int substeps = 10;

  // After the data was reset and forwarded: nothing has touched yet, the reference is where the arm
  // is.
  void reset() {
    std::fill(states.begin(), states.end(), JointState{});
    contact_ = Contact{};
    for (Region& r : regions) r.touching = 0;
    count_ = 0;
    sound_ = true;
    std::fill(rows.tau_ext, rows.tau_ext + joints.size(), 0.0);
    q_.assign(joints.size(), 0.0);
    for (std::size_t i = 0; i < joints.size(); ++i) q_[i] = at.qpos[qpos[i]];
    controls.override = Override::none;
    controls.command.origin = q_;
    controls.command.speed.assign(joints.size(), 0.0);
    controls.command.feed.assign(joints.size(), 0.0);
    finish();
  }

  void begin(const double* action) {
    contact_.begin_step();
    row_ = 0;
    for (std::size_t i = 0; i < joints.size(); ++i) q_[i] = at.qpos[qpos[i]];
    controls.take(chain, joints, tools(), tool_first, q_.data(), action);
    for (const Region& r : regions) turn_back(r);
  }

  // Up to `steps` physics steps; fewer where the simulation diverges.
  void run(int steps) {
    const std::size_t n = joints.size();
    for (int k = 0; k < steps && sound_; ++k, ++row_) {
      const double elapsed = row_ * dt;
      double *q = rows.q + row_ * n, *qd = rows.qd + row_ * n, *current = rows.current + row_ * n;
      for (std::size_t i = 0; i < n; ++i) {
        q[i] = at.qpos[qpos[i]];
        qd[i] = at.qvel[dof[i]];
        current[i] = drive(i, elapsed, q[i], qd[i]);
      }
      at.step(at.model, at.data);
      sound_ = finite();
      if (sound_) label();
      double* place = rows.region + 3 * row_ * regions.size();
      for (const Region& r : regions)
        place = std::copy(at.xpos + 3 * r.body, at.xpos + 3 * r.body + 3, place);
      ++count_;
    }
  }

  void finish() {
    if (sound_) {
      at.kinematics(at.model, at.data);
      controls.advance();
      observe();
    }
    report();
  }

  void step(const double* action) {
    begin(action);
    run(substeps);
    finish();
  }

  // The observation and figures once more, after a target has moved.
  void refresh() {
    if (sound_) observe();
    report();
  }

 private:
  // Beyond this speed [rad/s, m/s] a run counts as diverged; a cobot's joints stay below 10.
  static constexpr double velocity_bound = 1e3;
  Contact contact_;
  std::vector<double> q_;
  std::int64_t count_ = 0;
  int row_ = 0;
  bool sound_ = true;

  double drive(std::size_t i, double elapsed, double q, double qd) {
    const Joint& j = joints[i];
    JointState& s = states[i];
    double held = 0.0;
    const double command = controls.current(j, i, elapsed, q, qd, held);
    s.current = command + (s.current - command) * decay;
    const double tau = j.gain * s.current;
    at.qfrc[dof[i]] = tau - friction(j, s, qd, tau, dt) + ripple(j, q) + held;
    return s.current;
  }

  bool finite() const {
    for (int i = 0; i < nq; ++i)
      if (!std::isfinite(at.qpos[i])) return false;
    for (int i = 0; i < nv; ++i)
      if (!(std::fabs(at.qvel[i]) < velocity_bound)) return false;
    return true;
  }

  void label() {
    if (sensor_begin < 0) return;
    const std::size_t n = joints.size(), k = static_cast<std::size_t>(row_);
    read_links(chain, at.sensors + sensor_begin, static_cast<double>(count_) * dt, contact_,
               rows.tau + k * n, rows.contact + k * contact_width);
    std::copy(rows.tau + k * n, rows.tau + (k + 1) * n, rows.tau_ext);
    read_regions(regions, at.sensors, dt, contact_);
  }

  // A region that has left its span comes back at its own speed: a hand that goes to and fro.
  void turn_back(const Region& r) {
    if (r.joint < 0 || r.speed == 0) return;
    const double at_now = at.qpos[r.qpos];
    if (std::fabs(at_now) > r.span) at.qvel[r.dof] = at_now > 0 ? -r.speed : r.speed;
  }

  std::vector<Vec3> tools() const {
    std::vector<Vec3> out;
    for (std::size_t a = 0; a < tool_body.size(); ++a)
      out.push_back(tool_site[a] >= 0 ? load(at.site_xpos + 3 * tool_site[a])
                                      : load(at.xpos + 3 * tool_body[a]));
    return out;
  }

  // q, qd, torque; a tool's position and the way to its target; a region's position and velocity.
  void observe() {
    double* out = rows.observation;
    const auto put = [&](Vec3 v) {
      *out++ = v.x;
      *out++ = v.y;
      *out++ = v.z;
    };
    for (int i : qpos) *out++ = at.qpos[i];
    for (int i : dof) *out++ = at.qvel[i];
    for (std::size_t i = 0; i < joints.size(); ++i)
      *out++ = joints[i].nominal_gain * states[i].current;
    const std::vector<Vec3> at_tools = tools();
    double away = 0.0;
    for (Vec3 tool : at_tools) put(tool);
    for (std::size_t a = 0; a < at_tools.size(); ++a) {
      const Vec3 way = load(rows.target + 3 * a) - at_tools[a];
      away = std::max(away, norm(way));
      put(way);
    }
    for (const Region& r : regions) {
      put(load(at.xpos + 3 * r.body));
      put(r.joint >= 0 ? at.qvel[r.dof] * load(at.xaxis + 3 * r.joint) : Vec3{});
    }
    for (std::size_t k = 0; k < low.size(); ++k)
      rows.observation[k] = std::min(std::max(rows.observation[k], low[k]), high[k]);
    rows.figure[distance] = away;
  }

  void report() {
    double* f = rows.figure;
    f[time_now] = static_cast<double>(count_) * dt;
    f[force] = contact_.force;
    f[cost] = contact_.cost;
    f[ratio] = contact_.ratio;
    f[region_force] = contact_.region_force;
    f[onset] = contact_.onset ? 1.0 : 0.0;
    f[onset_time] = contact_.onset_time;
    f[link] = contact_.link;
    f[region] = contact_.region;
    f[diverged] = sound_ ? 0.0 : 1.0;
    double fastest = 0.0;
    for (std::size_t i = 0; i < joints.size(); ++i)
      fastest = std::max(fastest, std::fabs(at.qvel[dof[i]]) / controls.max_speed[i]);
    f[speed_ratio] = std::isfinite(fastest) ? fastest : 0.0;
  }
};

}  // namespace tauguard::envs
