// Energy while a guard is at work: what nothing but contacts can have added.
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

struct Entry {
  double gain;  // of all energy in a piece, less the work of drives, mocap and applied forces [J]
  double kinetic;  // at its end [J]
};

// Kinetic energy, gravity, springs and the stretch of flexes are added up; losses in joints and
// materials count as taken by contacts.
class Account {
 public:
  Account(const Engine& engine, Mocap& mocap, std::vector<Sheet> sheets, double share)
      : e_(engine),
        mocap_(mocap),
        sheets_(std::move(sheets)),
        share_(share),
        momentum_(engine.nv) {}

  // Start anew from this velocity (nv), at the start of the step that was just made.
  void open(const double* velocity) {
    balance_ = 0, allowed_ = share_ * kinetic(e_.data, velocity);
  }
  // Of the last piece, which began at `velocity` (nv) and ended at the vertices `x_t1`.
  Entry entry(const double* velocity, double length, const double* x_t1);
  bool overdrawn(const Entry& entry) const {
    return entry.gain > 0 && balance_ + entry.gain > allowed_;
  }
  void book(const Entry& entry) { balance_ += entry.gain; }

 private:
  double kinetic(const void* data, const double* velocity);
  double stretch(const double* x) const;
  double pushed(const double* velocity);

  const Engine& e_;
  Mocap& mocap_;
  std::vector<Sheet> sheets_;
  double share_, balance_ = 0, allowed_ = 0;
  std::vector<double> momentum_;
};

}  // namespace tauguard::contacts
