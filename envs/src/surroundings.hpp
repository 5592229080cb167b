// What a plant has besides its drives (links, people, contact sensors), and arrays for its results.
#pragma once

#include <cstddef>
#include <vector>

#include "kinematics.hpp"
#include "person.hpp"
#include "physics.hpp"
#include "regions.hpp"

namespace tauguard::envs {

// Metrics of one action; Python's StepMetrics has the same fields in this order.
struct Metrics {
  double time, distance, force, cost, limit_ratio, region_force;
  double onset, onset_time, link, region, diverged, speed_ratio, cost_sum, excess;
};
constexpr std::size_t metrics_width = sizeof(Metrics) / sizeof(double);

// The arms' links and tools, body regions, people, contact sensors and barriers.
struct Surroundings {
  Kinematics arms;
  std::vector<Tool> tools;
  std::vector<Region> regions;
  int people_begin = 0;  // index of the first person's first region; the others' regions follow
  std::vector<Person> people;
  std::vector<double> low, high;  // bounds of the observation
  int sensor_begin = -1;          // first contact sensor of the links; -1: none
  int arms_sensor = -1;           // sensor of the force between two arms; -1: none
  std::vector<int> people_geoms;  // geoms of the people's capsules, person after person
  Barriers barriers;              // obstacles that people's arms avoid
  TAUGUARD_FIELDS(arms, tools, regions, people_begin, people, low, high, sensor_begin, arms_sensor,
                  people_geoms, barriers)
};

// Output rows of an environment, in arrays that Python owns.
struct Rows {
  Held observation, metrics, tau_ext, target;
  Held q, qd, current, tau;  // physics steps x joints
  Held contact, region;      // physics steps x contact_width, physics steps x regions x 7
  Held tau_peak;             // joints
  Touched touched;           // peak contact of each region
  Held reaches, walks;       // the people's scripts: hands x rows x reach_width, rows x walk_width
  TAUGUARD_FIELDS(observation, metrics, tau_ext, target, q, qd, current, tau, contact, region,
                  tau_peak, touched, reaches, walks)

  Metrics& result() const { return *reinterpret_cast<Metrics*>(metrics.data()); }
};

// Output of a run along a table of references; row k belongs to the state before step k.
struct Track {
  Held q, qd, current;  // rows x joints
  Held sensors, poses;  // rows x numbers of the links' sensors, rows x bodies x 7
  std::vector<int> bodies;
  int sensor_begin = 0;
  // Force [N] and torque about the centre of mass [N m] on a body, rows x 6; body 0: none.
  const double* wrench = nullptr;
  int wrench_body = 0;
  TAUGUARD_FIELDS(q, qd, current, sensors, poses, bodies, sensor_begin)
};

}  // namespace tauguard::envs
