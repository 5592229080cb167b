// The energy budget of a guarded step: how much total energy contacts may add.
#pragma once

#include "mocap.hpp"

namespace tauguard::contacts {

// An elastic flex of triangles (St. Venant-Kirchhoff). Let e be the change of the squared edge
// lengths of an element and K its stiffness matrix. The energy of the element is e K e / 4, whose
// gradient is MuJoCo's spring force.
struct Sheet {
  std::vector<std::int32_t> ends;        // vertices at the ends of the edges, 6 per element
  std::vector<double> rest, stiffness;   // squared edge lengths at rest (3), and K (9 per element)
  double energy(const double* x) const;  // at vertices x (n, 3) [J]
};

struct EnergyChange {
  // Change of the total energy minus the work of drives, mocap and applied forces [J].
  double gain;
  double kinetic;  // kinetic energy at the end of the sub-step [J]
};

// Limits the energy that contacts add. The total energy consists of kinetic energy and the
// potential energy of gravity, springs and stretched flexes. Losses in joints and materials are
// counted as losses of contacts.
class EnergyBudget {
 public:
  EnergyBudget(const Engine& engine, Mocap& mocap, std::vector<Sheet> sheets, double share)
      : e_(engine),
        mocap_(mocap),
        sheets_(std::move(sheets)),
        fraction_(share),
        momentum_(engine.nv) {}

  // Starts a new budget: a fraction of the kinetic energy at the start of the last step, when the
  // velocity was `velocity` (nv).
  void open(const double* velocity) {
    gained_ = 0, allowed_ = fraction_ * kinetic(e_.data, velocity);
  }
  // Energy change of the last sub-step. `velocity` (nv) is the velocity at its start, `length` its
  // duration [s], `x_t1` the flex vertices at its end.
  EnergyChange change(const double* velocity, double length, const double* x_t1);
  bool exceeded(const EnergyChange& change) const {
    return change.gain > 0 && gained_ + change.gain > allowed_;
  }
  void record(const EnergyChange& change) { gained_ += change.gain; }
  void set_sheets(std::vector<Sheet> sheets) { sheets_ = std::move(sheets); }
  template <class Archive>
  void archive(Archive& a) {
    a(gained_), a(allowed_);
  }

 private:
  double kinetic(const void* data, const double* velocity);
  double stretch(const double* x) const;
  double pushed(const double* velocity);
  double moved_by_surfaces(const double* velocity, double length);

  const Engine& e_;
  Mocap& mocap_;
  std::vector<Sheet> sheets_;
  double fraction_, gained_ = 0, allowed_ = 0;
  std::vector<double> momentum_, rows_;
};

}  // namespace tauguard::contacts
