// Coulomb friction of impacts.
//
// The normal impulses p come from a step in which tangential velocities were kept. Given these, the
// friction impulses of at most friction * p minimize the kinetic energy (Coulomb's law; staggered
// projections: Kaufman, Sueda, James and Pai 2008). They are found by projected gradients with an
// exact line search, so the energy falls in every iteration.
#pragma once

#include "engine.hpp"

namespace tauguard::contacts {

class SlidingFriction {
 public:
  // The data must be in the state after mj_step2 of `model` with the duration `length` [s];
  // `velocity` (nv) is the velocity before it.
  SlidingFriction(const Engine& engine, const void* model, const std::vector<Contact>& contacts,
                  const std::vector<double>& velocity, double length);
  // Whether bodies slide at a contact with a normal impulse.
  bool acts() const;
  // The velocities of all constraint rows after the step with friction (nefc).
  const std::vector<double>& slowed();

 private:
  // A contact with a normal impulse. Friction impulses are stored divided by the coefficient.
  struct Slider {
    int row;                // first row of the contact
    double normal;          // normal impulse [N s]
    double coefficient[2];  // in both tangential directions
    double weight[2];       // inverse inertia, times the square of the coefficient [1/kg]
    double impulse[2], move[2];
  };
  double tangent(const Slider& s, int k, const std::vector<double>& rows) const;
  void project(double normal, double* impulse) const;
  // The velocities that the impulses `move` cause, in all rows.
  void respond();

  const Engine& e_;
  const void* model_;
  bool pyramidal_;
  std::vector<Slider> sliders_;
  std::vector<double> rows_, response_, forces_;  // (nefc)
  std::vector<double> joint_, moved_;             // (nv)
};

}  // namespace tauguard::contacts
