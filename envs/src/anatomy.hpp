// Parts of a person's motion: lengths and habits, the script, minimum-jerk paths (Flash & Hogan
// 1985) and reaches of a hand.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

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
  double step_back;  // after a touch [m]
  bool seated, hanging, reacts;
};

// The script, which is repeated. A row of `reaches` is one reach of a hand: wait [s], place [m],
// hold [s]. A row of `walks` is one walk: wait [s], place [m]; the first row is where the person
// starts.
struct Script {
  const double *reaches = nullptr, *walks = nullptr;
  std::size_t reach_rows = 0, walk_rows = 0;
};

constexpr int reach_width = 5, walk_width = 3;
// Peak over mean speed of a minimum-jerk path.
constexpr double peak_over_mean = 1.875;
// After a touch the hand withdraws at this multiple of its speed and stays away for this long [s].
constexpr double startle = 1.6, quiet = 1.0;
// Duration of a person's step back, and of the stay there [s].
constexpr double step_time = 0.6, step_lasts = 2.0;
// A seated person leans back instead, by this angle per metre of a step [rad/m], at most at this
// rate [rad/s].
constexpr double lean_back = 1.2, lean_rate = 1.2;
// Smallest force that a person feels [N]; turning rate [rad/s]. The body leans towards a goal
// farther than `comfort` times the arm's length, by at most `most_lean` [rad]. The arm extends to
// at most `stretch` times its length.
constexpr double felt = 1.0, turn_rate = 3.0, comfort = 0.95, stretch = 0.985, most_lean = 0.7;

// Palms, forearms and upper arms keep the distance `clearance` from barriers [m]. A hand that is
// stopped climbs at the speed `climb` [m/s] by at most `highest_climb` [m], and comes down at
// `descend` [m/s]. Before a walk the person takes both hands back. If they are not back within
// `patience` [s], the walk waits for as long again.
constexpr double clearance = 0.005, climb = 0.6, highest_climb = 0.6, descend = 0.2, patience = 2.0;

inline double minimum_jerk(double u) {
  u = std::min(std::max(u, 0.0), 1.0);
  return u * u * u * (10.0 + u * (6.0 * u - 15.0));
}

// Going from one value to another; done at `began + lasts`.
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
