// Impact zones, the last resort: partners that would pass through each other move rigidly together
// for a sub-step (Provot 1997; Bridson, Fedkiw and Anderson 2002).
#pragma once

#include <set>

#include "mocap.hpp"

namespace tauguard::contacts {

class ImpactZone {
 public:
  // The data must be in the state after the failed sub-step of `length` [s]: with its velocity, the
  // kinematics of its start and the mocap poses of its end.
  ImpactZone(const Engine& engine, const Mocap& mocap, double length);

  // Adds a pair; `vertices` of flexes that move rigidly with the geom, or with each other. False if
  // it was added before.
  bool add(int pair, const Partners& partners, const std::vector<std::int32_t>& vertices);
  // Changes the velocity of the failed sub-step by as little as possible, in the metric of the
  // inertia, so that the partners of each pair do not move relative to each other, and writes it to
  // the data. This removes kinetic energy and adds none, except for the work of mocap bodies on the
  // others [J]. False if the inertia gives no finite velocity.
  bool join(double* work);

 private:
  void add_rows(int count, int a, const double* at_a, int b, const double* at_b);
  void scale(std::vector<double>* square, std::vector<double>* speeds,
             std::vector<double>* factors) const;

  const Engine& e_;
  const Mocap& mocap_;
  double length_;
  std::set<std::pair<int, std::vector<std::int32_t>>> added_;
  std::vector<std::size_t> begin_;                 // first row of each pair
  std::vector<double> free_;                       // velocity of the failed sub-step (nv)
  std::vector<double> rows_, weighted_, carried_;  // Jacobian J (R, nv), J M^-1, mocap velocity (R)
};

}  // namespace tauguard::contacts
