#include "sliding_friction.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

constexpr int iterations = 24;
// Sliding is negligible if its speed is below this fraction of the change of the normal speed. The
// search ends if the energy falls by less than this fraction of its first fall.
constexpr double negligible = 1e-6;

}  // namespace

SlidingFriction::SlidingFriction(const Engine& engine, const void* model,
                                 const std::vector<Contact>& contacts,
                                 const std::vector<double>& velocity, double length)
    : e_(engine),
      model_(model),
      pyramidal_(*engine.cone == engine.pyramidal),
      rows_(*engine.efc_vel, *engine.efc_vel + *engine.nefc),
      response_(rows_.size()),
      forces_(rows_.size()),
      joint_(velocity.size()),
      moved_(velocity.size()) {
  for (const Contact& c : contacts) {
    if (c.dim < 3) continue;
    const int count = e_.normal_rows(c);
    double normal = 0;
    for (int row = c.row; row < c.row + count; ++row) normal += length * (*e_.efc_force)[row];
    if (!(normal > 0)) continue;
    Slider s{c.row, normal, {c.friction[0], c.friction[1]}, {}, {}, {}};
    for (int k = 0; k < 2; ++k) {
      const double square = s.coefficient[k] * s.coefficient[k];
      const double whole = (*e_.efc_diagA)[c.row + (pyramidal_ ? 2 * k : 0)];
      s.weight[k] = whole * square / (pyramidal_ ? 1 + square : 1);
    }
    sliders_.push_back(s);
  }
  for (std::size_t i = 0; i < moved_.size(); ++i) moved_[i] = e_.qvel[i] - velocity[i];
  e_.mul_jac(model_, e_.data, response_.data(), moved_.data());
  for (std::size_t i = 0; i < rows_.size(); ++i) rows_[i] += response_[i];
}

// The coefficient times the tangential velocity in the direction k.
double SlidingFriction::tangent(const Slider& s, int k, const std::vector<double>& rows) const {
  if (pyramidal_) return 0.5 * (rows[s.row + 2 * k] - rows[s.row + 2 * k + 1]);
  return s.coefficient[k] * rows[s.row + 1 + k];
}

bool SlidingFriction::acts() const {
  for (const Slider& s : sliders_)
    for (int k = 0; k < 2; ++k)
      if (std::fabs(tangent(s, k, rows_)) > negligible * s.normal * s.weight[k]) return true;
  return false;
}

// The nearest impulse within the cone: a square on its corner, or a circle.
void SlidingFriction::project(double normal, double* impulse) const {
  double a = std::fabs(impulse[0]), b = std::fabs(impulse[1]);
  if (pyramidal_) {
    const double over = 0.5 * (a + b - normal);
    if (over <= 0) return;
    a = std::max(a - over, 0.0), b = std::max(b - over, 0.0);
    a = std::min(a, normal), b = std::min(b, normal);
  } else {
    const double size = std::hypot(a, b);
    if (size <= normal) return;
    a *= normal / size, b *= normal / size;
  }
  impulse[0] = std::copysign(a, impulse[0]), impulse[1] = std::copysign(b, impulse[1]);
}

void SlidingFriction::respond() {
  std::fill(forces_.begin(), forces_.end(), 0.0);
  for (const Slider& s : sliders_)
    for (int k = 0; k < 2; ++k) {
      if (pyramidal_)
        forces_[s.row + 2 * k] = 0.5 * s.move[k], forces_[s.row + 2 * k + 1] = -0.5 * s.move[k];
      else
        forces_[s.row + 1 + k] = s.coefficient[k] * s.move[k];
    }
  e_.mul_jac_t(model_, e_.data, joint_.data(), forces_.data());
  e_.solve_m(model_, e_.data, moved_.data(), joint_.data(), 1);
  e_.mul_jac(model_, e_.data, response_.data(), moved_.data());
}

const std::vector<double>& SlidingFriction::slowed() {
  double step = 1, first = 0;
  for (int i = 0; i < iterations; ++i) {
    double slope = 0, curvature = 0, size = 0;
    for (Slider& s : sliders_) {
      double at[2];
      for (int k = 0; k < 2; ++k)
        at[k] = s.impulse[k] - (s.weight[k] > 0 ? step * tangent(s, k, rows_) / s.weight[k] : 0.0);
      project(s.normal, at);
      for (int k = 0; k < 2; ++k) {
        s.move[k] = at[k] - s.impulse[k];
        slope += s.move[k] * tangent(s, k, rows_);
        size += s.weight[k] * s.move[k] * s.move[k];
      }
    }
    if (i == 0) first = -slope;
    if (!(-slope > negligible * first)) break;
    respond();
    for (const Slider& s : sliders_)
      for (int k = 0; k < 2; ++k) curvature += s.move[k] * tangent(s, k, response_);
    if (!(curvature > 0)) break;
    const double share = std::min(-slope / curvature, 1.0);
    for (Slider& s : sliders_)
      for (int k = 0; k < 2; ++k) s.impulse[k] += share * s.move[k];
    for (std::size_t row = 0; row < rows_.size(); ++row) rows_[row] += share * response_[row];
    step = size / curvature;  // Barzilai and Borwein
  }
  return rows_;
}

}  // namespace tauguard::contacts
