// The plant: one scene's physics with its drives, under one of several control modes. Environments
// step it by actions; a simulation lets it follow a table of references.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "control.hpp"
#include "conveyance.hpp"
#include "drive.hpp"
#include "surroundings.hpp"

namespace tauguard::envs {

class Plant {
 public:
  Plant(Physics physics, DriveTrain drives)
      : physics_(std::move(physics)), drives_(std::move(drives)) {
    controls.override_speed.assign(drives_.size(), 0.0);
    q_.assign(drives_.size(), 0.0);
    drives_.relax();
  }
  Plant(const Plant&) = delete;  // its kinematics point into its physics
  Plant& operator=(const Plant&) = delete;

  Controls controls;
  int substeps = 1;
  std::vector<Carried> carried;
  std::vector<Belt> belts;

  // Prepares the plant for an environment: sets the surroundings of the arm and the output rows.
  void surround(Surroundings around, Rows rows) {
    around_ = std::move(around);
    around_.arms.physics = &physics_;
    rows_ = std::move(rows);
    around_.barriers.physics = &physics_;
    for (std::size_t p = 0; p < around_.people.size(); ++p)
      around_.people[p].bind(script(p), &around_.barriers,
                             around_.people_geoms.data() + p * person_segments);
  }

  std::size_t joints() const { return drives_.size(); }

  // Call after a reset of the data. Clears the currents, friction bristles and contact records.
  void relax() {
    drives_.relax();
    contact_ = Contact{};
    for (Region& r : around_.regions) r.touching = r.force = r.advance = 0;
    count_ = 0;
    sound_ = true;
    impossible_ = false;
    fastest_ = 0;
    carry();
  }

  // Call at the start of an episode, after a reset and mj_forward. Calls relax() and makes the
  // present joint positions the reference.
  void reset() {
    relax();
    row_ = 0;
    std::fill_n(rows_.tau_ext.data(), joints(), 0.0);
    clear_peaks();
    speeds_.assign(around_.regions.size(), Vec3{});
    for (std::size_t p = 0; p < around_.people.size(); ++p) {
      around_.people[p].reset(script(p));
      show_person(p);
    }
    for (std::size_t i = 0; i < joints(); ++i) q_[i] = physics_.qpos()[drives_.joints[i].qpos];
    controls.reset(q_);
    finish();
    rows_.result().cost_sum = 0;
  }

  void begin(const double* action) {
    contact_.begin_step();
    clear_peaks();
    row_ = 0;
    for (std::size_t i = 0; i < joints(); ++i) q_[i] = physics_.qpos()[drives_.joints[i].qpos];
    controls.take(around_.arms, drives_.joints, around_.tools, q_.data(), action);
    for (const Region& r : around_.regions) turn_back(r, physics_);
  }

  // Runs `steps` physics steps of the action; stops if the simulation diverges.
  void run(int steps) {
    const std::size_t n = joints();
    for (int k = 0; k < steps && sound_; ++k, ++row_) {
      advance(rows_.q.data() + row_ * n, rows_.qd.data() + row_ * n,
              rows_.current.data() + row_ * n);
      if (sound_) label();
      double* place = rows_.region.data() + 7 * row_ * around_.regions.size();
      for (const Region& r : around_.regions) {
        place = std::copy_n(physics_.position(r.body), 3, place);
        place = std::copy_n(physics_.quaternion(r.body), 4, place);
      }
    }
  }

  // Sends the nearest hand to a place [m] now, where it stays for `hold` [s].
  void aim(Vec3 place, double hold) {
    Person* nearest = nullptr;
    for (Person& person : around_.people)
      if (!nearest || person.away(place) < nearest->away(place)) nearest = &person;
    if (nearest) nearest->aim(place, hold, static_cast<double>(count_) * drives_.dt);
  }

  void finish() {
    if (sound_) {
      physics_.kinematics();
      controls.advance();
      measure_speeds();
      observe();
    }
    report();
    rows_.result().cost_sum += contact_.cost;
  }

  void step(const double* action) {
    begin(action);
    run(substeps);
    finish();
  }

  // Updates observation and metrics after a target has moved.
  void refresh() {
    if (sound_) observe();
    report();
  }

  // Follows `rows` rows of references; returns the number of steps before a divergence.
  std::size_t follow(const Table& table, std::size_t rows, const Track& track) {
    const std::size_t n = joints();
    const Mode before = std::exchange(controls.mode, Mode::table);
    controls.table = table;
    double* pushed = track.wrench_body > 0 ? physics_.wrench(track.wrench_body) : nullptr;
    std::size_t done = 0;
    for (row_ = 0; done < rows && sound_; ++row_) {
      if (pushed) std::copy_n(track.wrench + 6 * row_, 6, pushed);
      advance(track.q.data() + row_ * n, track.qd.data() + row_ * n,
              track.current.data() + row_ * n);
      if (!sound_) break;
      record(track);
      ++done;
    }
    if (pushed) std::fill_n(pushed, 6, 0.0);
    controls.mode = before;
    return done;
  }

  // The plant's state without MuJoCo's data, as numbers; their count is fixed.
  std::vector<double> state() {
    std::vector<double> out;
    visit([&](auto& value) { out.push_back(static_cast<double>(value)); });
    return out;
  }

  // Restores what state() returned. Returns false, and changes nothing, if it is of another plant.
  bool restore(const std::vector<double>& saved) {
    const std::vector<double> before = state();
    if (saved.size() != before.size()) return false;
    bool fits = true;
    std::size_t at = 0;
    visit([&](auto& value) { fits = holds(value, saved[at++]) && fits; });
    if (!fits) return false;
    assign(saved);
    fits = plausible();
    if (!fits) assign(before);
    return fits;
  }

 private:
  Physics physics_;
  DriveTrain drives_;
  Surroundings around_;
  Rows rows_;
  Contact contact_;
  std::vector<double> q_;
  std::vector<Vec3> speeds_;  // of the regions, after the action [m/s]
  std::int64_t count_ = 0;    // physics steps since the reset
  std::size_t row_ = 0;       // physics step of the action, or row of the table
  bool sound_ = true;
  bool impossible_ = false;  // unsound because of a force that the arm cannot exert
  double fastest_ = 0;       // largest ratio of joint speed to max_speed, after the last action

  template <class Visitor>
  void visit(Visitor&& each) {
    for (JointState& s : drives_.states) each(s.current), each(s.bristle);
    for (Region& r : around_.regions) each(r.touching), each(r.force), each(r.advance);
    speeds_.resize(around_.regions.size());
    for (Vec3& v : speeds_) each(v.x), each(v.y), each(v.z);
    for (Person& person : around_.people) person.visit(each);
    Contact& c = contact_;
    each(c.force), each(c.cost), each(c.excess), each(c.ratio), each(c.region_force);
    each(c.link), each(c.region), each(c.onset), each(c.onset_time), each(c.last);
    each(count_), each(sound_), each(impossible_), each(fastest_), each(controls.override);
    Command& command = controls.command;
    each(command.servo), each(command.powered), each(command.brake);
    for (auto* row : {&command.origin, &command.speed, &command.feed, &controls.override_speed}) {
      row->resize(joints(), 0.0);
      for (double& value : *row) each(value);
    }
  }

  void assign(const std::vector<double>& saved) {
    std::size_t at = 0;
    visit([&](auto& value) { value = static_cast<std::decay_t<decltype(value)>>(saved[at++]); });
  }

  // Whether all indices are in range.
  bool plausible() const {
    const auto within = [](int k, std::size_t most) {
      return k >= 0 && static_cast<std::size_t>(k) <= most;
    };
    return within(contact_.link, joints()) && within(contact_.region, around_.regions.size()) &&
           count_ >= 0 &&
           std::all_of(around_.people.begin(), around_.people.end(),
                       [](const Person& p) { return p.plausible(); });
  }

  // One physics step: writes the state before it, applies the drives' torques, calls mj_step.
  void advance(double* q, double* qd, double* current) {
    const double elapsed = static_cast<double>(row_) * drives_.dt;
    for (std::size_t i = 0; i < joints(); ++i) {
      const Joint& j = drives_.joints[i];
      q[i] = physics_.qpos()[j.qpos];
      qd[i] = physics_.qvel()[j.dof];
      const double held = controls.brake(j, i, q[i], qd[i]);
      const double wanted = controls.wanted(j, i, row_, elapsed, q[i], qd[i]);
      physics_.applied()[j.dof] = drives_.apply(i, wanted, q[i], qd[i]) + held;
      current[i] = drives_.states[i].current;
    }
    for (std::size_t p = 0; p < around_.people.size(); ++p) move_person(p);
    carry();
    physics_.step();
    sound_ = physics_.sound();
    ++count_;
  }

  void carry() {
    const double t = static_cast<double>(count_) * drives_.dt;
    for (const Carried& c : carried) c.follow(physics_, t);
    for (const Belt& b : belts) b.run(physics_);
  }

  // The script of person p: the reaches of both hands, and the walks.
  Script script(std::size_t p) const {
    const std::size_t reaches = rows_.reaches.shape(1);
    const std::size_t walks = rows_.walks.shape(0) / around_.people.size();
    return {rows_.reaches.data() + p * 2 * reaches * reach_width,
            rows_.walks.data() + p * walks * walk_width, reaches, walks};
  }

  std::size_t first_region(std::size_t p) const {
    return static_cast<std::size_t>(around_.people_begin) + p * person_segments;
  }

  void move_person(std::size_t p) {
    Person& person = around_.people[p];
    const double t = static_cast<double>(count_) * drives_.dt;
    for (int k = 0; k < person_segments; ++k)
      person.touch(k, around_.regions[first_region(p) + k].force, t);
    person.advance(t, drives_.dt);
    show_person(p);
  }

  void show_person(std::size_t p) {
    const Person& person = around_.people[p];
    for (int k = 0; k < person_segments; ++k) {
      const int mocap = around_.regions[first_region(p) + k].mocap;
      const Vec3 c = person.centre[k];
      double* place = physics_.mocap_position(mocap);
      place[0] = c.x, place[1] = c.y, place[2] = c.z;
      std::copy_n(person.quat_wxyz[k].data(), 4, physics_.mocap_quaternion(mocap));
    }
  }

  void clear_peaks() {
    std::fill_n(rows_.tau_peak.data(), joints(), 0.0);
    rows_.touched.clear();
  }

  // Velocities of the regions over the last physics step, by difference of positions.
  void measure_speeds() {
    if (row_ == 0) return;
    const std::size_t width = 7 * around_.regions.size();
    const double* before = rows_.region.data() + width * (row_ - 1);
    for (std::size_t i = 0; i < around_.regions.size(); ++i)
      speeds_[i] = (1.0 / drives_.dt) *
                   (load(physics_.position(around_.regions[i].body)) - load(before + 7 * i));
  }

  // Sensors and poses are those of the state before the step: mj_step evaluates them there.
  void record(const Track& track) const {
    const std::size_t width = track.sensors.shape(1);
    if (width)
      std::copy_n(physics_.sensors() + track.sensor_begin, width,
                  track.sensors.data() + row_ * width);
    double* pose = track.poses.data() + row_ * track.bodies.size() * 7;
    for (int body : track.bodies) {
      pose = std::copy_n(physics_.position(body), 3, pose);
      pose = std::copy_n(physics_.quaternion(body), 4, pose);
    }
  }

  void label() {
    if (around_.sensor_begin < 0) return;
    const std::size_t n = joints();
    double* tau = rows_.tau.data() + row_ * n;
    const Contact before = contact_;
    read_links(around_.arms, physics_.sensors() + around_.sensor_begin,
               static_cast<double>(count_ - 1) * drives_.dt, contact_, tau,
               rows_.contact.data() + row_ * contact_width);
    if (!possible()) {
      contact_ = before;
      sound_ = false;
      impossible_ = true;
      return;
    }
    std::copy_n(tau, n, rows_.tau_ext.data());
    double* peak = rows_.tau_peak.data();
    for (std::size_t i = 0; i < n; ++i)
      if (std::fabs(tau[i]) > std::fabs(peak[i])) peak[i] = tau[i];
    const double* arms = physics_.sensors() + around_.arms_sensor;
    const double between = around_.arms_sensor < 0 || arms[0] == 0 ? 0.0 : norm(load(arms + 1));
    const Sensed step{physics_.sensors() + around_.sensor_begin, physics_.sensors(),
                      rows_.qd.data() + row_ * n, drives_.dt};
    read_regions(around_.regions, around_.arms, step, contact_, rows_.touched, between);
  }

  // Whether the arm can exert the largest force so far; a solver that failed reports any force.
  bool possible() const {
    const double squared = contact_.force * contact_.force;
    if (squared <= controls.moving + controls.driven) return true;
    double fastest = std::max(1.0, fastest_);
    for (std::size_t k = 0; k <= row_; ++k)
      for (std::size_t i = 0; i < joints(); ++i)
        fastest =
            std::max(fastest, std::fabs(rows_.qd.data()[k * joints() + i]) / controls.max_speed[i]);
    return squared <= fastest * fastest * controls.moving + controls.driven;
  }

  // In this order: q, qd, torque; each tool's position; each tool's vector to its target; position
  // and velocity of each region.
  void observe() {
    double* out = rows_.observation.data();
    const auto put = [&](Vec3 v) {
      *out++ = v.x;
      *out++ = v.y;
      *out++ = v.z;
    };
    for (const Joint& j : drives_.joints) *out++ = physics_.qpos()[j.qpos];
    for (const Joint& j : drives_.joints) *out++ = physics_.qvel()[j.dof];
    for (std::size_t i = 0; i < joints(); ++i)
      *out++ = drives_.joints[i].nominal_gain * drives_.states[i].current;
    double away = 0.0;
    for (const Tool& tool : around_.tools) put(around_.arms.tool(tool));
    for (std::size_t a = 0; a < around_.tools.size(); ++a) {
      const Vec3 left = load(rows_.target.data() + 3 * a) - around_.arms.tool(around_.tools[a]);
      away = std::max(away, norm(left));
      put(left);
    }
    for (std::size_t i = 0; i < around_.regions.size(); ++i) {
      const Region& r = around_.regions[i];
      put(load(physics_.position(r.body)));
      put(r.joint >= 0 ? physics_.qvel()[r.dof] * load(physics_.axis(r.joint)) : speeds_[i]);
    }
    double* seen = rows_.observation.data();
    for (std::size_t k = 0; k < around_.low.size(); ++k)
      seen[k] = std::min(std::max(seen[k], around_.low[k]), around_.high[k]);
    rows_.result().distance = away;
  }

  void report() {
    Metrics& m = rows_.result();
    m.time = static_cast<double>(count_) * drives_.dt;
    m.force = contact_.force;
    m.cost = contact_.cost;
    m.excess = contact_.excess;
    m.limit_ratio = contact_.ratio;
    m.region_force = contact_.region_force;
    m.onset = contact_.onset ? 1.0 : 0.0;
    m.onset_time = contact_.onset_time;
    m.link = contact_.link;
    m.region = contact_.region;
    m.diverged = sound_ ? 0.0 : impossible_ ? 2.0 : 1.0;
    double fastest = 0.0;
    for (std::size_t i = 0; i < joints(); ++i)
      fastest = std::max(fastest,
                         std::fabs(physics_.qvel()[drives_.joints[i].dof]) / controls.max_speed[i]);
    m.speed_ratio = fastest_ = std::isfinite(fastest) ? fastest : 0.0;
  }
};

}  // namespace tauguard::envs
