// A sub-step in which the solver stops the approach of chosen pairs before they are deep.
//
// The margins of the chosen pairs are as wide as the pair may travel, so that MuJoCo lists every
// place in which they are about to meet. Between mj_step1 and mj_step2 each of their rows gets a
// target velocity for the end of the sub-step. At a signed distance d > 0 and a length h of the
// sub-step the bodies approach at most at d / h; in overlap they do not approach. The solver then
// finds the least change of velocity (in the metric of the inertia) that satisfies these rows. All
// of them allow standing still, so the change removes energy and adds none, except to push an
// overlap out. Mocap bodies carry others along by their own velocity, which MuJoCo's rows do not
// contain. They push without friction: with MuJoCo's friction, bodies that slide at a speed v
// separate at mu v. A ball between a paddle and a table, which must slide on one of them, would
// then leave at many times the paddle's speed.
#pragma once

#include "mocap.hpp"
#include "stiffening.hpp"

namespace tauguard::contacts {

// A pair whose approach is stopped, and how far it may travel in the sub-step [m].
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

  // One mj_step of `length` [s]; overlaps are pushed out at most at `push` times their depth [1/s].
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
