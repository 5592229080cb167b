// Friction as a weighted sum of columns, functions of position, velocity and drive torque.
//
// Presliding and Coulomb friction come in two forms, both in [-1, 1] and rate-independent:
// * a Dahl bristle of settling length d: ds = (dq - s |dq|) / d, integrated exactly over a step;
// * a stop operator of width d: s = (q - rest) / d, where rest follows q beyond the distance d.
// Noise of the position would reset a bristle. So the bristle follows a position that moves only if
// the measured one is more than `play` away. With b the first bristle, or the first stop if there
// is no bristle, the columns of one joint are, in this order,
//   1, qd, bristles, stops, b exp(-(qd/w)^2) for each Stribeck velocity w, tanh(qd/w) for each
//   width w, |load| b, |load| tanh(qd/w) for each loaded width w, cos(c q), sin(c q) for each
//   ripple frequency c, tau |tau| with `saturation`
// The load is the drive's torque or, with `modelled`, the torque by the arm's model. The drive
// torque of a joint without load is mostly friction, so as the load it would predict friction from
// friction.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>
#include <vector>

namespace tauguard::detectors {

class FrictionBasis {
 public:
  std::vector<double> bristles;  // settling lengths [rad]
  std::vector<double> stops;     // widths [rad]
  std::vector<double> stribeck;  // [rad/s]
  std::vector<double> slopes;    // tanh widths [rad/s]
  std::vector<double> loaded;    // tanh widths of load-dependent friction [rad/s]
  bool saturation = false;       // the column tau |tau|
  bool modelled = false;         // the load is the modelled torque
  std::vector<double> cycles;    // per joint, `ripples` each [1/rad]
  std::size_t ripples = 0;
  double play = 0.0;  // [rad]

  static constexpr std::size_t offset_at = 0, viscous_at = 1, first_at = 2;

  std::size_t columns() const { return smooth() + 2 * ripples + (saturation ? 1 : 0); }
  // Columns [first_at, smooth()) are the columns of Coulomb friction.
  std::size_t smooth() const {
    return first_at + bristles.size() + stops.size() + stribeck.size() + slopes.size() + 1 +
           loaded.size();
  }

  // Columns [loaded_at, smooth()) are the load-dependent columns of Coulomb friction.
  std::size_t loaded_at() const { return smooth() - 1 - loaded.size(); }

  // Number of a joint's states: position with play, bristles, rest positions of the stops.
  std::size_t memory() const { return 1 + bristles.size() + stops.size(); }

  void reset(double q, double* memory) const {
    *memory++ = q;
    for (std::size_t k = 0; k < bristles.size(); ++k) *memory++ = 0.0;
    for (std::size_t k = 0; k < stops.size(); ++k) *memory++ = q;
  }

  void evaluate(std::size_t joint, double q, double qd, double tau, double load, double* memory,
                double* out) const {
    *out++ = 1.0;
    *out++ = qd;
    const double* coulomb = out;
    const double before = *memory;
    *memory = std::clamp(before, q - play, q + play);
    const double moved = *memory++ - before;
    for (const double length : bristles) {
      if (moved != 0.0) {
        const double settled = moved > 0 ? 1.0 : -1.0;
        *memory = settled + (*memory - settled) * std::exp(-std::fabs(moved) / length);
      }
      *out++ = *memory++;
    }
    for (const double width : stops) {
      *memory = std::clamp(*memory, q - width, q + width);
      *out++ = (q - *memory++) / width;
    }
    const double b = *coulomb;
    for (const double w : stribeck) *out++ = b * std::exp(-(qd / w) * (qd / w));
    for (const double w : slopes) *out++ = std::tanh(qd / w);
    *out++ = std::fabs(load) * b;
    for (const double w : loaded) *out++ = std::fabs(load) * std::tanh(qd / w);
    for (std::size_t h = 0; h < ripples; ++h) {
      const double phase = cycles[joint * ripples + h] * q;
      *out++ = std::cos(phase);
      *out++ = std::sin(phase);
    }
    if (saturation) *out++ = tau * std::fabs(tau);
  }

  bool operator==(const FrictionBasis& other) const {
    const auto all = [](const FrictionBasis& b) {
      return std::tie(b.bristles, b.stops, b.stribeck, b.slopes, b.loaded, b.saturation, b.modelled,
                      b.cycles, b.ripples, b.play);
    };
    return all(*this) == all(other);
  }
};

}  // namespace tauguard::detectors
