#include "energy_budget.hpp"

namespace tauguard::contacts {

double Sheet::energy(const double* x) const {
  double sum = 0;
  for (std::size_t k = 0; k < rest.size() / 3; ++k) {
    double change[3];
    for (int i = 0; i < 3; ++i) {
      const double *p = x + 3 * ends[6 * k + 2 * i], *q = x + 3 * ends[6 * k + 2 * i + 1];
      const double d[3] = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};
      change[i] = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - rest[3 * k + i];
    }
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) sum += change[i] * stiffness[9 * k + 3 * i + j] * change[j];
  }
  return sum / 4;
}

EnergyChange EnergyBudget::change(const double* velocity, double length, const double* x_t1) {
  e_.com_pos(e_.model, e_.end);
  if (e_.ntendon) e_.tendon(e_.model, e_.end);
  e_.make_m(e_.model, e_.end);
  const double kinetic_end = kinetic(e_.end, e_.qvel);
  e_.energy_pos(e_.model, e_.data);
  e_.energy_pos(e_.model, e_.end);
  const double place = mocap_.shifted() ? mocap_.potential() + stretch(mocap_.vertices())
                                        : e_.energy[0] + stretch(e_.flexvert_xpos);
  const double before = kinetic(e_.data, velocity) + place;
  double driven = 0;
  std::vector<double> mean(velocity, velocity + e_.nv);
  for (int i = 0; i < e_.nv; ++i) {
    mean[i] = 0.5 * (mean[i] + e_.qvel[i]);
    driven += (e_.qfrc_actuator[i] + e_.qfrc_applied[i]) * mean[i];
  }
  driven = length * (driven + pushed(mean.data())) + mocap_.work(mean.data(), length) +
           moved_by_surfaces(velocity, length);
  return {kinetic_end + e_.end_energy[0] + stretch(x_t1) - before - driven, kinetic_end};
}

double EnergyBudget::kinetic(const void* data, const double* velocity) {
  e_.mul_m(e_.model, data, momentum_.data(), velocity);
  double sum = 0;
  for (int i = 0; i < e_.nv; ++i) sum += velocity[i] * momentum_[i];
  return 0.5 * sum;
}

double EnergyBudget::stretch(const double* x) const {
  double sum = 0;
  for (const Sheet& sheet : sheets_) sum += sheet.energy(x);
  return sum;
}

// Work of surfaces that move while their geom does not, such as belts [J]. `velocity` is that at
// the start. MuJoCo's efc_vel is relative to the surface.
double EnergyBudget::moved_by_surfaces(const double* velocity, double length) {
  if (!*e_.surfaces_move || !*e_.nefc) return 0;
  rows_.resize(*e_.nefc);
  e_.mul_jac(e_.model, e_.data, rows_.data(), velocity);
  double work = 0;
  for (int row = 0; row < *e_.nefc; ++row)
    work += length * (*e_.efc_force)[row] * (rows_[row] - (*e_.efc_vel)[row]);
  return work;
}

// Power of the applied forces [W].
double EnergyBudget::pushed(const double* velocity) {
  double power = 0;
  std::vector<double> jacobian;
  for (int b = 0; b < e_.nbody; ++b) {
    const double* w = e_.xfrc_applied + 6 * b;
    bool any = false;
    for (int k = 0; k < 6; ++k) any = any || w[k] != 0;
    if (!any) continue;
    jacobian.resize(6 * static_cast<std::size_t>(e_.nv));
    e_.jac_com(e_.model, e_.data, jacobian.data(), jacobian.data() + 3 * e_.nv, b);
    for (int k = 0; k < 6; ++k)
      for (int i = 0; i < e_.nv; ++i)
        power += w[k] * jacobian[static_cast<std::size_t>(k) * e_.nv + i] * velocity[i];
  }
  return power;
}

}  // namespace tauguard::contacts
