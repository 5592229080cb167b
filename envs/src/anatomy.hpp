// Parts of a person's motion: lengths and habits, the script, minimum-jerk paths (Flash & Hogan
// 1985) and reaches of a hand.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "tauguard/geometry/fields.hpp"
#include "tauguard/geometry/vec3.hpp"

namespace tauguard::envs {

using geometry::load;
using geometry::norm;
using geometry::Vec3;

enum Segment { skull, neck, chest, abdomen, pelvis, limbs };
// Segments of a limb, numbered after `limbs`; the left side comes first.
enum Limb { upper_arm, lower_arm, hand, thigh, lower_leg, per_side };
constexpr int person_segments = limbs + 2 * per_side;

// Lengths [m], place and habits; see tauguard.models.Person.
struct Anatomy {
  double hip_height, trunk, shoulder, hip_half, neck, head;
  double upper_arm, lower_arm, hand, grip, thigh, shank;
  double floor, facing, hand_speed, walk_speed, reaction_time;
  double step_back;  // distance of the step back after a touch [m]
  bool seated, hanging, reacts;
  TAUGUARD_FIELDS(hip_height, trunk, shoulder, hip_half, neck, head, upper_arm, lower_arm, hand,
                  grip, thigh, shank, floor, facing, hand_speed, walk_speed, reaction_time,
                  step_back, seated, hanging, reacts)
};

// The script of a person, which is repeated. A row of `reaches` is one reach of a hand: wait [s],
// place [m], hold [s]. A row of `walks` is one walk: wait [s], place [m]; the first row is where
// the person starts.
struct Script {
  const double *reaches = nullptr, *walks = nullptr;
  std::size_t reach_rows = 0, walk_rows = 0;
};

constexpr int reach_width = 5, walk_width = 3;
// Peak over mean speed of a minimum-jerk path.
constexpr double peak_over_mean = 1.875;
constexpr double startle = 1.6;    // speed of a touched hand's withdrawal, in units of `hand_speed`
constexpr double quiet = 1.0;      // rest of the hand after this withdrawal [s]
constexpr double step_time = 0.6;  // duration of the step back after a touch [s]
constexpr double step_lasts = 2.0;  // time for which the person then stays back [s]
constexpr double lean_back = 1.2;   // backward lean of a seated person per `step_back` [rad/m]
constexpr double lean_rate = 1.2;   // largest rate of a lean [rad/s]
constexpr double felt = 1.0;        // smallest force that a person feels [N]
constexpr double turn_rate = 3.0;   // largest rate of a turn [rad/s]
constexpr double comfort = 0.95;    // lean towards goals beyond this fraction of the arm's length
constexpr double stretch = 0.985;   // largest extension of the arm as a fraction of its length
constexpr double most_lean = 0.7;   // largest forward lean [rad]

constexpr double clearance = 0.005;    // distance of palms and arms from barriers [m]
constexpr double climb = 0.6;          // speed at which a hand that a barrier stops rises [m/s]
constexpr double highest_climb = 0.6;  // largest rise of such a hand [m]
constexpr double descend = 0.2;        // speed at which the hand comes down again [m/s]
// Before a walk the person withdraws both hands. If they are not at rest after this time [s], the
// person waits for the same time and tries again.
constexpr double patience = 2.0;

inline double minimum_jerk(double u) {
  u = std::min(std::max(u, 0.0), 1.0);
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

// Minimum-jerk change from one value to another, from the time `began` to `began + lasts` [s].
struct Course {
  double from = 0, to = 0, began = 0, lasts = 1;
  double at(double t) const { return from + (to - from) * minimum_jerk((t - began) / lasts); }
  bool done(double t) const { return t - began >= lasts; }
  template <class Each>
  void visit(Each&& each) {
    each(from), each(to), each(began), each(lasts);
  }
};

// A hand rests beside the body, goes to a place in the world, stays there and comes back.
struct Reach {
  enum Phase { resting, going, holding, returning };
  int phase = resting, next = 0;
  double until = 0, hold = 0, began = 0, lasts = 1;  // [s]
  Vec3 from, goal;
};

}  // namespace tauguard::envs
