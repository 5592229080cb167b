// A person's motion: reaches, walks between places, withdrawal after a touch. It depends on the
// script, the time, the touches and the barriers. The result is a pose of every capsule of
// tauguard.models.person, in that order.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <utility>

#include "anatomy.hpp"
#include "barriers.hpp"
#include "posture.hpp"

namespace tauguard::envs {

class Person : public Posture {
 public:
  Person() = default;
  explicit Person(const Anatomy& anatomy) : Posture(anatomy) {}

  // Starts the script from its beginning.
  void reset(const Script& script) {
    script_ = script;
    from_ = to_ = walk_place(0);
    path_ = Course{};
    walking_ = false;
    next_walk_ = 0;
    until_ = script_.walks[0];
    turned_ = body_.facing;
    stride_ = swing_ = back_until_ = 0;
    lowered_ = body_.hanging;
    back_ = Course{};
    touched_.fill(-1.0);
    for (int side = 0; side < 2; ++side) {
      hands_[side] = Reach{};
      hands_[side].until = reach_row(side, 0)[0];
    }
    lean_ = 0;
    held_up_.fill(false), raised_.fill(0.0);
    pose(0.0, 0.0);
  }

  // `geoms`: MuJoCo's ids of the capsules, in their order; read only if there are barriers.
  void bind(const Script& script, const Barriers* barriers, const int* geoms) {
    script_ = script;
    barriers_ = barriers && !barriers->all.empty() ? barriers : nullptr;
    geoms_ = geoms;
  }

  // Computes the state at time t [s], which is dt after the last call.
  void advance(double t, double dt) {
    react(t);
    walk(t, dt);
    for (int side = 0; side < 2; ++side) move_hand(side, t);
    pose(t, dt);
  }

  // A region was touched by this force [N] at time t [s].
  void touch(int segment, double force, double t) {
    if (body_.reacts && force > felt && touched_[segment] < 0) touched_[segment] = t;
  }

  // Distance of the nearer hand from a place [m].
  double away(Vec3 place) const { return std::min(norm(place - grip_[0]), norm(place - grip_[1])); }

  // Sends the nearer hand to a place at once; the script's next reach follows after its return.
  void aim(Vec3 place, double hold, double t) {
    if (walking_ || body_.hanging) return;
    const auto away = [&](int side) { return norm(place - grip_[side]); };
    start(away(0) <= away(1) ? 0 : 1, place, hold, t);
  }

  template <class Each>
  void visit(Each&& each) {
    for (Reach& h : hands_) {
      each(h.phase), each(h.next), each(h.until), each(h.hold), each(h.began), each(h.lasts);
      visit(h.from, each), visit(h.goal, each);
    }
    visit(from_, each), visit(to_, each);
    path_.visit(each), back_.visit(each);
    each(walking_), each(next_walk_), each(until_), each(back_until_);
    each(turned_), each(stride_), each(swing_), each(lowered_), each(lean_);
    for (double& t : touched_) each(t);
    for (Vec3& g : grip_) visit(g, each);
    for (bool& held : held_up_) each(held);
    for (double& height : raised_) each(height);
    visit(axes_.forward, each), visit(axes_.left, each), visit(axes_.hip, each);
  }

  // Whether the phases are valid and the rows exist in the script.
  bool plausible() const {
    const auto row_of = [](int k, std::size_t rows) {
      return k >= 0 && static_cast<std::size_t>(k) < std::max<std::size_t>(rows, 1);
    };
    for (const Reach& h : hands_)
      if (h.phase < Reach::resting || h.phase > Reach::returning ||
          !row_of(h.next, script_.reach_rows))
        return false;
    return row_of(next_walk_, script_.walk_rows);
  }

 private:
  Script script_;
  const Barriers* barriers_ = nullptr;
  const int* geoms_ = nullptr;
  std::array<Reach, 2> hands_;
  Vec3 from_, to_;  // of a walk
  Course path_, back_;
  bool walking_ = false;
  int next_walk_ = 0;
  double until_ = 0, back_until_ = 0;
  double turned_ = 0;               // yaw [rad]
  double lowered_ = 0;              // the hands: 0 in front, 1 beside the body
  std::array<bool, 2> held_up_{};   // an object stops the hand
  std::array<double, 2> raised_{};  // height of the hand above its path, to pass an object [m]
  std::array<double, person_segments> touched_{};  // time of the last touch [s]; -1: none

  template <class Each>
  static void visit(Vec3& v, Each&& each) {
    each(v.x), each(v.y), each(v.z);
  }

  const double* reach_row(int side, int row) const {
    return script_.reaches + reach_width * (side * script_.reach_rows + row);
  }
  Vec3 walk_place(int row) const {
    const double* w = script_.walks + walk_width * row;
    return {w[1], w[2], body_.floor + body_.hip_height};
  }

  double path_time(double far, double speed) const {
    return std::max(0.4, peak_over_mean * far / speed);
  }

  void start(int side, Vec3 place, double hold, double t) {
    Reach& h = hands_[side];
    const double far = norm(place - grip_[side]);
    h.phase = Reach::going;
    h.hold = hold;
    h.began = t;
    h.lasts = path_time(far, body_.hand_speed);
    h.from = grip_[side];
    h.goal = place;
  }

  void withdraw(int side, double t, double speed, double rest) {
    Reach& h = hands_[side];
    h.until = std::max(h.until, t + rest);
    if (h.phase == Reach::resting || h.phase == Reach::returning) return;
    h.phase = Reach::returning;
    h.began = t;
    h.lasts = path_time(norm(h.goal - rest_place(side)), speed);
    h.from = grip_[side];
    h.until = t + h.lasts + rest;
  }

  void move_hand(int side, double t) {
    Reach& h = hands_[side];
    if (h.phase == Reach::resting) {
      if (t < h.until || walking_ || body_.hanging || script_.reach_rows == 0) return;
      const double* row = reach_row(side, h.next);
      h.next = (h.next + 1) % static_cast<int>(script_.reach_rows);
      start(side, load(row + 1), row[4], t);
    } else if (h.phase == Reach::going && t - h.began >= h.lasts) {
      h.phase = Reach::holding;
      h.until = t + h.hold;
      if (held_up_[side]) h.goal = grip_[side];
    } else if (h.phase == Reach::holding && t >= h.until) {
      withdraw(side, t, body_.hand_speed, reach_row(side, h.next)[0]);
    } else if (h.phase == Reach::returning && t - h.began >= h.lasts) {
      h.phase = Reach::resting;
    }
  }

  void walk(double t, double dt) {
    if (!walking_ && t >= until_ && script_.walk_rows > 1 && hands_are_back(t)) {
      next_walk_ = (next_walk_ + 1) % static_cast<int>(script_.walk_rows);
      from_ = to_;
      to_ = walk_place(next_walk_);
      path_ = {0.0, 1.0, t, path_time(norm(to_ - from_), body_.walk_speed)};
      walking_ = true;
      for (int side = 0; side < 2; ++side) withdraw(side, t, body_.hand_speed, path_.lasts);
    } else if (walking_ && path_.done(t)) {
      walking_ = false;
      until_ = t + script_.walks[walk_width * next_walk_];
    }
    const Vec3 path = to_ - from_;
    const bool far = walking_ && norm(path) > 0.5 && path_.done(t + 0.6) == false;
    turn(far ? std::atan2(path.y, path.x) : body_.facing, dt);
    lowered_ += std::min(std::max((walking_ || body_.hanging) - lowered_, -2.0 * dt), 2.0 * dt);
    const double speed = walking_ ? norm(path) * (path_.at(t) - path_.at(t - dt)) / dt : 0.0;
    swing_ = 0.4 * std::min(1.0, speed / 1.0);
    stride_ += speed * dt * 4.0;  // [rad/m]: a step of 0.8 m
  }

  // Near barriers a person withdraws the hands before a walk. Returns whether they are at rest.
  bool hands_are_back(double t) {
    if (!barriers_) return true;
    bool back = true;
    for (int side = 0; side < 2; ++side) {
      withdraw(side, t, body_.hand_speed, patience);
      back = back && hands_[side].phase == Reach::resting && !held_up_[side];
    }
    if (!back && t > until_ + patience) until_ = t + patience;
    return back;
  }

  void turn(double wanted, double dt) {
    const double error = std::remainder(wanted - turned_, 2.0 * M_PI), most = turn_rate * dt;
    turned_ += std::min(std::max(error, -most), most);
  }

  // The touched hand, or the body, draws back after the reaction time.
  void react(double t) {
    for (int k = 0; k < person_segments; ++k) {
      if (touched_[k] < 0 || t - touched_[k] < body_.reaction_time) continue;
      touched_[k] = -1.0;
      const int limb = (k - limbs) % per_side, side = (k - limbs) / per_side;
      if (k >= limbs && limb <= hand) {
        withdraw(side, t, startle * body_.hand_speed, quiet);
        continue;
      }
      for (int h = 0; h < 2; ++h) withdraw(h, t, startle * body_.hand_speed, quiet);
      if (back_.to < body_.step_back) back_ = {back_.at(t), body_.step_back, t, step_time};
      back_until_ = t + step_time + step_lasts;
    }
    if (back_.to > 0 && t >= back_until_) back_ = {back_.at(t), 0.0, t, 2 * step_time};
  }

  // Place of a resting hand: in front of the body, or beside it during walks or if `hanging`.
  Vec3 rest_place(int side) const {
    const double sign = side == 0 ? 1.0 : -1.0, reach = body_.upper_arm + body_.lower_arm;
    const Vec3 up{0, 0, 1};
    const double down = minimum_jerk(lowered_);
    const double ahead = (0.75 - 0.8 * down) * reach;
    const double aside = (0.9 + 0.35 * down) * body_.shoulder;
    const double height = body_.trunk - (0.7 + 0.3 * down) * reach;
    return axes_.hip + ahead * axes_.forward + sign * aside * axes_.left + height * up;
  }

  Vec3 hand_place(int side, double t) const {
    const Reach& h = hands_[side];
    const double u = minimum_jerk((t - h.began) / h.lasts);
    switch (h.phase) {
      case Reach::going:
        return mix(h.from, h.goal, u);
      case Reach::holding:
        return h.goal;
      case Reach::returning:
        return mix(h.from, rest_place(side), u);
      default:
        return rest_place(side);
    }
  }

  void pose(double t, double dt) {
    const double back = back_.at(t);
    axes_.forward = {std::cos(turned_), std::sin(turned_), 0};
    axes_.left = {-std::sin(turned_), std::cos(turned_), 0};
    axes_.hip = mix(from_, to_, walking_ ? path_.at(t) : 1.0);
    if (!body_.seated) axes_.hip += -back * axes_.forward;
    const std::array<Vec3, 2> last = grip_;
    const Vec3 goals[2] = {hand_place(0, t), hand_place(1, t)};
    double lean = 0.0;
    for (int side = 0; side < 2; ++side) {
      const double sign = side == 0 ? 1.0 : -1.0;
      const Vec3 upright =
          axes_.hip + Vec3{0, 0, 0.96 * body_.trunk} + sign * body_.shoulder * axes_.left;
      const double far =
          norm(goals[side] - upright) - comfort * (body_.upper_arm + body_.lower_arm + body_.grip);
      lean = std::max(lean, std::min(most_lean, far / body_.trunk));
    }
    if (body_.seated) lean -= lean_back * back;
    const double before = std::exchange(
        lean_, lean_ + std::min(std::max(lean - lean_, -lean_rate * dt), lean_rate * dt));
    const auto body = [&] {
      trunk_and_head();
      const Vec3 up = trunk_axis(), neck_base = axes_.hip + body_.trunk * up;
      double least = 0;
      if (lean_ > before) least = nearest({skull, neck, chest, abdomen}).distance - clearance;
      for (int side = 0; side < 2; ++side) {
        const double sign = side == 0 ? 1.0 : -1.0;
        const Vec3 shoulder =
            neck_base + sign * body_.shoulder * axes_.left - 0.04 * body_.trunk * up;
        arm(side, shoulder, goals[side], sign);
        if (!barriers_ || dt == 0) continue;
        keep_clear(side, shoulder, goals[side], sign, last[side], dt);
        least = std::min(least, nearest_to_arm(side).distance);
      }
      return least;
    };
    // If the new lean presses trunk, head or an arm into a barrier, the old lean is kept.
    if (body() < 0 && lean_ != before) {
      lean_ = before;
      body();
    }
    for (int side = 0; side < 2; ++side) leg(side, side == 0 ? 1.0 : -1.0);
  }

  // The gap between the given capsules and the nearest barrier, if it is below `clearance`.
  Gap nearest(std::initializer_list<int> segments) const {
    Gap out;
    if (!barriers_) return out;
    for (const int k : segments) {
      const Gap gap = barriers_->nearest(geoms_[k], centre[k], quat_wxyz[k], clearance);
      if (gap.distance < out.distance) out = gap;
    }
    return out;
  }

  Gap nearest_to_arm(int side) const {
    const int at = limbs + side * per_side;
    return nearest({at + upper_arm, at + lower_arm, at + hand});
  }

  // Corrects an arm that has just been posed towards a goal, starting from the last place of the
  // palm. A palm that a barrier stops slides along the barrier and climbs over it. The palm then
  // moves at most at the speed of a startled hand.
  void keep_clear(int side, Vec3 shoulder, Vec3 goal, double sign, Vec3 last, double dt) {
    Vec3 want = goal;
    if (held_up_[side]) {
      want.z += raised_[side];
      const Vec3 path = want - last;
      const double far = norm(path), most = startle * body_.hand_speed * dt;
      if (far > most) want = last + (most / far) * path;
      arm(side, shoulder, want, sign);
    }
    Gap gap = nearest_to_arm(side);
    const bool blocked = gap.distance < clearance;
    for (int k = 0; k < 8 && gap.distance < clearance; ++k) {
      want = grip_[side] + (clearance - gap.distance) * gap.away;
      arm(side, shoulder, want, sign);
      gap = nearest_to_arm(side);
    }
    if (gap.distance < 0) {
      const double pushed = gap.distance;
      arm(side, shoulder, last, sign);
      if (nearest_to_arm(side).distance < pushed) arm(side, shoulder, want, sign);
    }
    const bool climbs = blocked && hands_[side].phase != Reach::holding;
    const double height = raised_[side] + (climbs ? climb : -descend) * dt;
    raised_[side] = std::min(std::max(height, 0.0), highest_climb);
    held_up_[side] = blocked || raised_[side] > 0 || norm(grip_[side] - goal) > 1e-3;
  }
};

}  // namespace tauguard::envs
