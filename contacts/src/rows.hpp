// A sub-step in which the solver stops the approach of chosen ("held") pairs before they are deep.
//
// * The margin of a held pair is the largest approach in the sub-step, so that MuJoCo lists all
//   places in which the pair may meet.
// * Between mj_step1 and mj_step2 each constraint row of these contacts gets a target velocity for
//   the end of the sub-step. At a signed distance d > 0 the bodies approach at most at d / h, where
//   h is the length of the sub-step. In overlap they do not approach.
// * The solver finds the least change of velocity, in the metric of the inertia, that satisfies the
//   rows. All rows allow standing still, so the change removes energy and adds none, except to push
//   out an overlap.
// * MuJoCo's rows do not contain the velocity of mocap bodies, so it is added here. Mocap bodies
//   push without friction: with MuJoCo's friction, bodies that slide at a speed v separate at mu v.
//   A ball between a paddle and a table, which must slide on one of them, would leave at many times
//   the speed of the paddle.
#pragma once

#include "mocap.hpp"
#include "stiffening.hpp"

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
        geoms_(engine.ngeom, 0),
        flexes_(static_cast<std::size_t>(engine.nflex), 0) {}

  // One mj_step of `length` [s]. Overlaps are pushed out at `push` [1/s] times the depth.
  void step(double length, const std::vector<Held>& held, double push);

 private:
  void aim(double length, double push);
  void aim_contact(const Contact& contact, double length, double push);

  const Engine& e_;
  const std::vector<Partners>& pairs_;
  const Mocap& mocap_;
  std::vector<char> geoms_, flexes_;
};

}  // namespace tauguard::contacts
