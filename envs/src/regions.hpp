// Contacts of the arm at every physics step: net force, external joint torque, onset of a
// collision, and the force on each body region with its limits.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "kinematics.hpp"
#include "physics.hpp"

namespace tauguard::envs {

// A body region in the scene; `joint`, `qpos` and `dof` are -1 if it is held in place.
struct Region {
  int body = -1, joint = -1, qpos = -1, dof = -1;
  int mocap = -1;                          // mocap id of a person's capsule; -1: no person's
  bool held = false;                       // cannot move away
  int sensor = -1;                         // address of its contact sensor's ten numbers
  double quasi_static = 0, transient = 0;  // limits [N]; transient 0: no impact is allowed
  double span = 0;                         // distance from its origin at which it turns back [m]
  double speed = 0;                        // its speed when it turns back [m/s]
  double area = 0;                         // area of the robot's contact surface [cm^2]; 0: unknown
  double least_pressure = 0;  // pressure of a flat contact surface, for an unknown area [N/cm^2]
  double stiffness = 0;       // stiffness of its contact [N/m]
  double touching = 0;        // duration of the present contact [s]
  double force = 0;           // at the last physics step [N]
  double advance = 0;         // advance of the arm into the region in this contact [m]
  TAUGUARD_FIELDS(body, joint, qpos, dof, mocap, held, sensor, quasi_static, transient, span, speed,
                  area, least_pressure, stiffness)
};

// Turns back a region that has left its span, so that it moves to and fro like a hand.
inline void turn_back(const Region& r, const Physics& physics) {
  if (r.joint < 0 || r.speed == 0) return;
  const double at_now = physics.qpos()[r.qpos];
  if (std::fabs(at_now) > r.span) physics.qvel()[r.dof] = at_now > 0 ? -r.speed : r.speed;
}

// The peak contact of each region over an action: force [N], pressure [N/cm^2], point [m],
// direction of the force on it.
struct Touched {
  Held force, pressure, point, direction;
  TAUGUARD_FIELDS(force, pressure, point, direction)

  void clear() const {
    for (const Held* h : {&force, &pressure, &point, &direction})
      std::fill_n(h->data(), h->size(), 0.0);
  }
};

// The largest values over one control step, and the state of the collision.
struct Contact {
  double force = 0;         // peak net force on a link [N]
  double cost = 0;          // impulse beyond the regions' limits that the arm causes [N s]
  double excess = 0;        // impulse beyond the regions' limits, whoever causes it [N s]
  double ratio = 0;         // peak ratio of a region's force to its limit
  double region_force = 0;  // peak force on a region [N]
  int link = 0;             // 1-based, of the peak force; 0: none
  int region = 0;           // 1-based, of the peak ratio; 0: none
  bool onset = false;
  double onset_time = -1, last = -1e9;  // [s]
  void begin_step() {
    force = cost = excess = ratio = region_force = 0;
    link = region = 0;
    onset = false;
  }
};

constexpr double merge_gap = 0.5;       // contacts closer than this are one collision [s]
constexpr double transient_time = 0.5;  // longer contacts are quasi-static [s]
constexpr int sensor_width = 10;        // found, force (3), torque (3), position (3)

// The record of a physics step: net force on the arm [N]; link, point [m] and vector [N] of the
// largest force on a link. Without contact the numbers are 0, except the point, which is NaN.
constexpr int contact_width = 8;

// Reads the links' contact sensors at time t, and writes tau_ext to tau and the contact to row.
inline void read_links(const Kinematics& arms, const double* sensor, double t, Contact& c,
                       double* tau, double* row) {
  std::fill(tau, tau + arms.size(), 0.0);
  std::fill(row, row + contact_width, 0.0);
  std::fill(row + 2, row + 5, std::numeric_limits<double>::quiet_NaN());
  double strongest = 0;
  Vec3 net;
  for (std::size_t link = 0; link < arms.size(); ++link) {
    const double* s = sensor + sensor_width * link;
    if (s[0] == 0) continue;
    const Vec3 force = -1.0 * load(s + 1), torque = -1.0 * load(s + 4);
    const double size = norm(force);
    if (size == 0) continue;
    arms.push(link, load(s + 7), force, torque, tau);
    net = net + force;
    if (size > strongest) {
      strongest = size;
      row[1] = static_cast<double>(link) + 1;
      std::copy(s + 7, s + 10, row + 2);
      row[5] = force.x, row[6] = force.y, row[7] = force.z;
    }
    if (size > c.force) {
      c.force = size;
      c.link = static_cast<int>(link) + 1;
    }
  }
  row[0] = norm(net);
  if (strongest > 0) {
    if (t - c.last >= merge_gap) {
      c.onset = true;
      c.onset_time = t;
    }
    c.last = t;
  }
}

// Speed [m/s] along a direction of a point that moves with the link whose contact is nearest to it.
inline double speed_of(const Kinematics& arms, const double* links, const double* qd, Vec3 point,
                       Vec3 direction) {
  std::size_t link = arms.size();
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < arms.size(); ++i) {
    const double* s = links + sensor_width * i;
    const double away = norm(load(s + 7) - point);
    if (s[0] != 0 && away < nearest) nearest = away, link = i;
  }
  return link < arms.size() ? dot(arms.velocity(link, point, qd), direction) : 0.0;
}

// Inputs of a physics step's record: sensors of the links, all sensors, joint velocities.
struct Sensed {
  const double *links, *all, *qd;
  double dt;
};

// Reads the regions' contact sensors. The limit of an impact is the transient limit. The limit of
// contact that lasts longer than `transient_time`, or on a region that cannot move away, is the
// quasi-static one. (With a transient limit of 0, `ratio` is relative to the quasi-static limit.)
// The excess is the impulse beyond the limit. The cost is the part that the arm causes: a force
// counts at most as the stiffness times the arm's advance during the contact, so the cost is 0 if
// somebody runs into an arm at rest. `between` is the force between two arms, which must not touch;
// all of it is excess and cost.
inline void read_regions(std::vector<Region>& regions, const Kinematics& arms, const Sensed& step,
                         Contact& c, const Touched& peak, double between) {
  double caused = between, whole = between;
  for (std::size_t i = 0; i < regions.size(); ++i) {
    Region& r = regions[i];
    const double* s = step.all + r.sensor;
    const double force = s[0] == 0 ? 0.0 : norm(load(s + 1));
    r.force = force;
    if (force == 0) {
      r.touching = r.advance = 0;
      continue;
    }
    r.touching += step.dt;
    const Vec3 direction = (-1.0 / force) * load(s + 1);
    r.advance += step.dt * speed_of(arms, step.links, step.qd, load(s + 7), direction);
    const bool impact = !r.held && r.touching <= transient_time;
    const double limit = impact ? r.transient : r.quasi_static;
    const double ratio = force / (limit > 0 ? limit : r.quasi_static);
    caused += std::max(0.0, std::min(force, r.stiffness * r.advance) - limit);
    whole += std::max(0.0, force - limit);
    c.region_force = std::max(c.region_force, force);
    if (force > peak.force.data()[i]) {
      double* d = peak.direction.data() + 3 * i;
      peak.force.data()[i] = force;
      peak.pressure.data()[i] = r.area > 0 ? force / r.area : r.least_pressure;
      std::copy(s + 7, s + 10, peak.point.data() + 3 * i);
      d[0] = direction.x, d[1] = direction.y, d[2] = direction.z;
    }
    if (ratio > c.ratio) {
      c.ratio = ratio;
      c.region = static_cast<int>(i) + 1;
    }
  }
  c.cost += step.dt * caused;
  c.excess += step.dt * whole;
}

}  // namespace tauguard::envs
