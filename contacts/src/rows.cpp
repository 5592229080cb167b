#include "rows.hpp"

#include <algorithm>

namespace tauguard::contacts {
namespace {

// Contact parameters of held pairs. `time` [s] is the time constant of the rows; the integrator
// `discrete` uses `discrete_time`, with which they act within one step.
constexpr double time = 1e-4, discrete_time = 1e-6;
constexpr double impedance[] = {0.99, 0.999, 0.001, 0.5, 2.0};

constexpr int least_iterations = 100;

// Indexed by Place::Kind (explicit pair, geom, flex):
constexpr int frictions[] = {5, 3, 3};   // number of friction coefficients
constexpr int tangents[] = {2, 1, 1};    // number of coefficients of sliding friction
constexpr double least_friction = 1e-5;  // MuJoCo's smallest coefficient (mjMINMU)

}  // namespace

// Writes the contact parameters of a held pair to the copy of the model. The object that has the
// parameters gets a priority above the other partner's, so that MuJoCo does not mix them.
void Rows::hold(const Held& held) {
  const Partners& p = pairs_[held.pair];
  const Place at = p.carrier;
  const double solref[] = {is_discrete() ? discrete_time : time, 1.0};
  double& margin = copy_.margin(at.kind)[at.number];
  margin = std::max(margin, held.margin);
  std::copy_n(solref, 2, copy_.solref(at.kind) + 2 * at.number);
  std::copy_n(impedance, 5, copy_.solimp(at.kind) + 5 * at.number);
  if (mocap_.carries(p))
    std::fill_n(copy_.friction(at.kind) + frictions[at.kind] * at.number, tangents[at.kind],
                least_friction);
  if (at.kind != Place::pair) {
    const Place& other = p.first == at ? p.second : p.first;
    int& priority = copy_.priority(at.kind)[at.number];
    priority = std::max(priority, copy_.priority(other.kind)[other.number] + 1);
  }
  if (at.kind == Place::flex)
    flexes_[at.number] = 1;
  else if (at.kind == Place::geom)
    geoms_[at.number] = 1;
  else
    geoms_[e_.pair_geom1[at.number]] = geoms_[e_.pair_geom2[at.number]] = 1;
  if (!(*e_.enableflags & e_.override_flag)) return;
  double& all = copy_.option(e_.o_margin);  // the override replaces the parameters of all contacts
  all = std::max(all, held.margin);
  std::copy_n(solref, 2, &copy_.option(e_.o_solref));
  std::copy_n(impedance, 5, &copy_.option(e_.o_solimp));
}

bool Rows::step(const double* start, double length, const std::vector<Held>& held, int most,
                double push) {
  push_ = push;
  copy_.take();
  copy_.option(e_.timestep) = length;
  if (united_) copy_.option(e_.integrator) = e_.discrete;
  // Solvers other than Newton do not converge on stiff rows, so pairs would pass through.
  copy_.option(e_.solver) = e_.newton;
  copy_.option(e_.iterations) = std::max(*e_.iterations, least_iterations);
  if (is_discrete()) copy_.option(e_.disableflags) |= e_.refsafe;
  std::fill(geoms_.begin(), geoms_.end(), 0), std::fill(flexes_.begin(), flexes_.end(), 0);
  for (const Held& h : held) hold(h);
  const int full = *e_.full[0] + *e_.full[1];
  e_.step1(copy_.get(), e_.data);
  if (!held.empty() && (*e_.ncon > most || *e_.full[0] + *e_.full[1] > full)) return false;
  choose();
  if (chosen_.empty()) return e_.step2(copy_.get(), e_.data), true;
  const std::vector<double> velocity(e_.qvel, e_.qvel + e_.nv);
  solve(length, std::vector<double>(*e_.efc_vel, *e_.efc_vel + *e_.nefc));
  SlidingFriction friction(e_, copy_.get(), chosen_, velocity, length);
  if (!friction.acts()) return true;
  e_.set_state(e_.model, e_.data, start, e_.signature.integration);
  solve(length, friction.slowed());
  return true;
}

// Completes the step with the targets of `aim`. The integrator `discrete` takes no targets of the
// tangential rows of elliptic cones, except by the velocities of surfaces.
void Rows::solve(double length, const std::vector<double>& tangents) {
  if (!(is_discrete() && *e_.cone == e_.elliptic)) {
    aim(length, tangents);
    return e_.step2(copy_.get(), e_.data);
  }
  const std::vector<double> rows(*e_.efc_vel, *e_.efc_vel + *e_.nefc);
  bool& moves = copy_.option(e_.surfaces_move);
  std::vector<double> before;
  for (int k = 0; k < *e_.ncon; ++k) {
    double* surface = e_.contact_at(k).surface;
    if (!moves) std::fill_n(surface, 3, 0.0);
    before.insert(before.end(), surface, surface + 3);
  }
  const bool moved = std::exchange(moves, true);
  aim(length, tangents);
  e_.step2(copy_.get(), e_.data);
  for (int k = 0; k < *e_.ncon; ++k) std::copy_n(&before[3 * k], 3, e_.contact_at(k).surface);
  std::copy(rows.begin(), rows.end(), *e_.efc_vel);
  moves = moved;
}

// Lists the contacts of held objects that have rows.
void Rows::choose() {
  chosen_.clear();
  for (int k = 0; *e_.nefc && k < *e_.ncon; ++k) {
    const Contact contact = e_.contact_at(k);
    bool chosen = false;
    for (int i = 0; i < 2; ++i)
      chosen = chosen || (contact.geom[i] >= 0 && geoms_[contact.geom[i]]) ||
               (contact.flex[i] >= 0 && flexes_[contact.flex[i]]);
    if (chosen && contact.row >= 0) chosen_.push_back(contact);
  }
}

// Sets the targets of the chosen contacts' rows. `tangents` has, for each row, the velocity of the
// row with the tangential velocity that is wanted.
void Rows::aim(double length, const std::vector<double>& tangents) {
  const double* now = *e_.efc_vel;
  for (const Contact& contact : chosen_) {
    const int first = contact.row, count = e_.normal_rows(contact);
    // With a pyramidal cone the normal velocity is the mean of two opposite edges.
    const double normal =
        count > 1 ? 0.5 * (tangents[first] + tangents[first + 1]) : tangents[first];
    const double out = push_ * std::max(-contact.distance, 0.0);
    const double speed =
        out - (std::max(contact.distance, 0.0) + mocap_.separation(contact)) / length;
    const int rows = count > 1 ? count : contact.dim;
    for (int row = first; row < first + rows; ++row) {
      const double target = tangents[row] + (row < first + count ? speed - normal : 0.0);
      const int tangent = row - first - count;
      if (is_discrete() && tangent >= 0) {
        if (tangent < 3) contact.surface[tangent] -= target;
      } else if (is_discrete())
        (*e_.efc_margin)[row] = (*e_.efc_pos)[row] + length * target;
      else
        (*e_.efc_aref)[row] = (target - now[row]) / length;
    }
  }
}

}  // namespace tauguard::contacts
