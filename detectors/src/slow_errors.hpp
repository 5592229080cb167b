// The Kalman filter of slowly changing errors of a model: a payload, which loads every joint, and
// errors that concern one joint each.
//
// Each state is an Ornstein-Uhlenbeck process with a standard deviation and a time constant.
// Without measurements it decays to zero, which is the calibrated model. A standard deviation of 0
// removes a state. A measurement is one joint's residual. It depends only on the payload and on the
// joint's own errors.
//
// To limit the effect of collisions, an innovation of z standard deviations, z above c = `clip`, is
// replaced by one of c^2 / z standard deviations.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace tauguard::detectors {

constexpr int payload_numbers = 4;  // mass [kg] and first moment in the last link's frame [kg m]
constexpr int per_joint = 3;        // errors of one joint: offset, viscous, Coulomb

class SlowErrors {
 public:
  // Standard deviations and time constants [s] of the states: those of the payload, then those of
  // each joint; 4 + 3 n numbers each.
  SlowErrors(std::vector<double> deviation, std::vector<double> persistence, double clip)
      : m_(deviation.size()),
        clip_(clip),
        deviation_(std::move(deviation)),
        persistence_(std::move(persistence)),
        state_(m_),
        gathered_(m_),
        row_(m_),
        covariance_(m_ * m_) {
    reset();
  }

  const std::vector<double>& state() const { return state_; }
  bool any() const {
    return std::any_of(deviation_.begin(), deviation_.end(), [](double d) { return d > 0; });
  }

  void reset() {
    std::fill(state_.begin(), state_.end(), 0.0);
    std::fill(covariance_.begin(), covariance_.end(), 0.0);
    for (std::size_t a = 0; a < m_; ++a) covariance_[a * m_ + a] = deviation_[a] * deviation_[a];
  }

  // The residual that the states predict at joint j. The arguments are the derivatives of the
  // residual by the payload and by the joint's own errors.
  double predicted(std::size_t j, const double* payload, const double* own) const {
    double sum = 0.0;
    for (int a = 0; a < payload_numbers; ++a) sum += payload[a] * state_[a];
    for (int a = 0; a < per_joint; ++a) sum += own[a] * state_[first(j) + a];
    return sum;
  }

  // Variance of the residual due to the payload.
  double payload_variance(const double* payload) const {
    double sum = 0.0;
    for (int a = 0; a < payload_numbers; ++a)
      for (int b = 0; b < payload_numbers; ++b)
        sum += payload[a] * covariance_[a * m_ + b] * payload[b];
    return sum;
  }

  // Variance of the residual due to all states.
  double variance(std::size_t j, const double* payload, const double* own) {
    set_row(j, payload, own);
    return gather(j);
  }

  // Time update over `elapsed` [s].
  void fade(double elapsed) {
    for (std::size_t a = 0; a < m_; ++a)
      row_[a] = a >= per_joint && persistence_[a] == persistence_[a - per_joint]
                    ? row_[a - per_joint]
                    : std::exp(-elapsed / persistence_[a]);
    for (std::size_t a = 0; a < m_; ++a) {
      state_[a] *= row_[a];
      for (std::size_t b = 0; b < m_; ++b) covariance_[a * m_ + b] *= row_[a] * row_[b];
      covariance_[a * m_ + a] += (1 - row_[a] * row_[a]) * deviation_[a] * deviation_[a];
    }
  }

  // Corrects the states by joint j's residual, whose noise has `variance`. Because the noise is
  // correlated over `inflation` corrections, the variance is multiplied by that number, except for
  // the clipping of the innovation.
  void correct(std::size_t j, double residual, const double* payload, const double* own,
               double variance, double inflation) {
    set_row(j, payload, own);
    const double believed = gather(j), total = inflation * variance + believed;
    const double limit = clip_ * std::sqrt(variance + believed);
    double innovation = residual - predicted(j, payload, own);
    if (std::fabs(innovation) > limit) innovation = limit * limit / innovation;
    for (std::size_t a = 0; a < m_; ++a) {
      const double k = gathered_[a] / total;
      state_[a] += k * innovation;
      for (std::size_t b = 0; b <= a; ++b) {
        covariance_[a * m_ + b] -= k * gathered_[b];
        covariance_[b * m_ + a] = covariance_[a * m_ + b];
      }
    }
  }

 private:
  static std::size_t first(std::size_t j) { return payload_numbers + per_joint * j; }

  void set_row(std::size_t j, const double* payload, const double* own) {
    std::fill(row_.begin(), row_.end(), 0.0);
    std::copy_n(payload, payload_numbers, row_.begin());
    std::copy_n(own, per_joint, row_.begin() + static_cast<std::ptrdiff_t>(first(j)));
  }

  // Writes covariance times row; returns the variance of the prediction.
  double gather(std::size_t j) {
    for (std::size_t b = 0; b < m_; ++b) {
      double sum = 0.0;
      for (int a = 0; a < payload_numbers; ++a) sum += covariance_[b * m_ + a] * row_[a];
      for (int a = 0; a < per_joint; ++a)
        sum += covariance_[b * m_ + first(j) + a] * row_[first(j) + a];
      gathered_[b] = sum;
    }
    double believed = 0.0;
    for (std::size_t b = 0; b < m_; ++b) believed += row_[b] * gathered_[b];
    return believed;
  }

  std::size_t m_;
  double clip_;
  std::vector<double> deviation_, persistence_, state_, gathered_, row_, covariance_;
};

}  // namespace tauguard::detectors
