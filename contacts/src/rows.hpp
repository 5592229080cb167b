// A sub-step in which the solver stops the approach of chosen ("held") pairs before they are deep.
//
// * The margin of a held pair is the largest approach in the sub-step, so that MuJoCo lists all
//   places in which the pair may meet. Its contacts are rigid: with soft ones the solver would only
//   slow the approach.
// * Between mj_step1 and mj_step2 each constraint row of these contacts gets a target velocity for
//   the end of the sub-step. At a signed distance d > 0 the bodies approach at most at d / h, where
//   h is the length of the sub-step. In overlap they do not approach.
// * The solver finds the least change of velocity, in the metric of the inertia, that satisfies the
//   rows. All rows allow standing still, so the change removes energy and adds none, except to push
//   out an overlap: at the speed at which a contact with MuJoCo's default parameters would.
// * MuJoCo's cones are convex: bodies that slide at a speed v separate at friction * v. So the
//   targets of the tangential rows are the velocities with which Coulomb's law is satisfied
//   (sliding_friction.hpp), and no sliding is left that could lift a body.
// * MuJoCo's rows do not contain the velocity of mocap bodies, so it is added here. Mocap bodies
//   push without friction. A ball between a paddle and a table, which must slide on one of them,
//   would leave at many times the speed of the paddle.
#pragma once

#include "mocap.hpp"
#include "model_copy.hpp"
#include "sliding_friction.hpp"

namespace tauguard::contacts {

// A held pair, and the margin of its contacts [m].
struct Held {
  int pair;
  double margin;
};

class Rows {
 public:
  Rows(const Engine& engine, const std::vector<Partners>& pairs, const Mocap& mocap)
      : e_(engine),
        pairs_(pairs),
        mocap_(mocap),
        copy_(engine),
        geoms_(engine.ngeom, 0),
        flexes_(static_cast<std::size_t>(engine.nflex), 0) {}

  void bind(void* model) { copy_.bind(model); }
  // One mj_step of `length` [s] from the data's state, which `start` contains
  // (mjSTATE_INTEGRATION).
  // Whether the next sub-steps use the integrator `discrete`, whose solver knows what damping and
  // servos do within the step. The other integrators add it afterwards: their solver pushes a light
  // body on a strongly damped joint with next to no force, and it stays in the way. False if
  // nothing changes.
  bool unite(bool discrete) {
    if (discrete && (e_.is_discrete() || united_)) return false;
    return united_ = discrete, true;
  }
  // Overlaps are pushed out at `push` [1/s] times the depth.
  // Stops after mj_step1 and returns false if there are more than `most` contacts, or more than
  // MuJoCo has memory for.
  bool step(const double* start, double length, const std::vector<Held>& held, int most,
            double push);

 private:
  bool is_discrete() const { return united_ || e_.is_discrete(); }
  void hold(const Held& held);
  void choose();
  void solve(double length, const std::vector<double>& tangents);
  void aim(double length, const std::vector<double>& tangents);

  const Engine& e_;
  const std::vector<Partners>& pairs_;
  const Mocap& mocap_;
  ModelCopy copy_;
  bool united_ = false;
  double push_ = 0;
  std::vector<char> geoms_, flexes_;
  std::vector<Contact> chosen_;  // contacts of held objects
};

}  // namespace tauguard::contacts
