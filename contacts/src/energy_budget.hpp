// The energy budget of a guarded step: how much kinetic energy contacts may add.
#pragma once

#include "mocap.hpp"

namespace tauguard::contacts {

// An elastic flex of triangles: the ends of its edges, their squares at rest, and the stiffness,
// element by element. Its energy is e K e / 4, e the change of the squares.
struct Sheet {
  std::vector<std::int32_t> ends;       // 6 an element
  std::vector<double> rest, stiffness;  // 3 and 9 an element
  double energy(const double* x) const;
};

struct EnergyChange {
  double
      gain;  // of all energy in a sub-step, less the work of drives, mocap and applied forces [J]
  double kinetic;  // at its end [J]
};

// Counts kinetic energy, gravity, springs and the stretch of flexes. Losses in joints and materials
// count as taken by contacts.
class EnergyBudget {
 public:
  EnergyBudget(const Engine& engine, Mocap& mocap, std::vector<Sheet> sheets, double share)
      : e_(engine),
        mocap_(mocap),
        sheets_(std::move(sheets)),
        fraction_(share),
        momentum_(engine.nv) {}

  // Starts a new budget from this velocity (nv), at the start of the step that was just made.
  void open(const double* velocity) {
    gained_ = 0, allowed_ = fraction_ * kinetic(e_.data, velocity);
  }
  // Of the last sub-step, which began at `velocity` (nv) and ended at the vertices `x_t1`.
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

  const Engine& e_;
  Mocap& mocap_;
  std::vector<Sheet> sheets_;
  double fraction_, gained_ = 0, allowed_ = 0;
  std::vector<double> momentum_;
};

}  // namespace tauguard::contacts
