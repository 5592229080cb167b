#include "rows.hpp"

#include <algorithm>

namespace tauguard::contacts {
namespace {

// Time constant [s] of constraint rows with the integrator `discrete`: they act within one step.
constexpr double rigid = 1e-6;

constexpr int least_iterations = 100;

// Indexed by Place::Kind (explicit pair, geom, flex):
constexpr int frictions[] = {5, 3, 3};   // number of friction coefficients
constexpr int tangents[] = {2, 1, 1};    // number of coefficients of sliding friction
constexpr double least_friction = 1e-5;  // MuJoCo's smallest coefficient (mjMINMU)

// Restores margins, parameters and flags when it is destroyed, also by an exception.
class Borrowed {
 public:
  explicit Borrowed(const Engine& e)
      : e_(e), flags_(*e.disableflags), solver_(*e.solver), iterations_(*e.iterations) {}
  ~Borrowed() {
    *e_.disableflags = flags_, *e_.solver = solver_, *e_.iterations = iterations_;
    for (auto it = saved_.rbegin(); it != saved_.rend(); ++it) *it->first = it->second;
  }
  Borrowed(const Borrowed&) = delete;
  Borrowed& operator=(const Borrowed&) = delete;
  void set(double* place, double value) {
    saved_.emplace_back(place, *place);
    *place = value;
  }

 private:
  const Engine& e_;
  int flags_, solver_, iterations_;
  std::vector<std::pair<double*, double>> saved_;
};

}  // namespace

void Rows::step(double length, const std::vector<Held>& held, double push) {
  const bool discrete = e_.is_discrete();
  Borrowed borrowed(e_);
  *e_.timestep = length;
  // Solvers other than Newton do not converge on stiff rows, so pairs would pass through.
  *e_.solver = e_.newton, *e_.iterations = std::max(*e_.iterations, least_iterations);
  std::fill(geoms_.begin(), geoms_.end(), 0), std::fill(flexes_.begin(), flexes_.end(), 0);
  for (const Held& h : held) {
    const Place at = pairs_[h.pair].carrier;
    double* margin = e_.margin[at.kind] + at.number;
    borrowed.set(margin, std::max(*margin, h.margin));
    if (mocap_.carries(pairs_[h.pair]))
      for (int k = 0; k < tangents[at.kind]; ++k)
        borrowed.set(e_.friction[at.kind] + frictions[at.kind] * at.number + k, least_friction);
    if (discrete) {
      borrowed.set(e_.solref[at.kind] + 2 * at.number, rigid);
      borrowed.set(e_.solref[at.kind] + 2 * at.number + 1, 1.0);
    }
    if (at.kind == Place::flex)
      flexes_[at.number] = 1;
    else if (at.kind == Place::geom)
      geoms_[at.number] = 1;
    else
      geoms_[e_.pair_geom1[at.number]] = geoms_[e_.pair_geom2[at.number]] = 1;
  }
  if (*e_.enableflags & e_.override_flag) {  // the override replaces the parameters of all contacts
    for (const Held& h : held) borrowed.set(e_.o_margin, std::max(*e_.o_margin, h.margin));
    if (discrete && !held.empty())
      borrowed.set(e_.o_solref, rigid), borrowed.set(e_.o_solref + 1, 1.0);
  }
  if (discrete) *e_.disableflags |= e_.refsafe;
  e_.step1(e_.model, e_.data);
  aim(length, push);
  e_.step2(e_.model, e_.data);
}

void Rows::aim(double length, double push) {
  if (!*e_.nefc) return;
  for (int k = 0; k < *e_.ncon; ++k) {
    const Contact contact = e_.contact_at(k);
    bool chosen = false;
    for (int i = 0; i < 2; ++i)
      chosen = chosen || (contact.geom[i] >= 0 && geoms_[contact.geom[i]]) ||
               (contact.flex[i] >= 0 && flexes_[contact.flex[i]]);
    if (chosen && contact.row >= 0) aim_contact(contact, length, push);
  }
}

void Rows::aim_contact(const Contact& contact, double length, double push) {
  const int first = contact.row, count = e_.normal_rows(contact);
  const bool discrete = e_.is_discrete();
  const double* now = *e_.efc_vel;
  // With a pyramidal cone the normal speed is the mean over the first two opposite edges.
  const double normal = count > 1 ? 0.5 * (now[first] + now[first + 1]) : now[first];
  const double apart =
      contact.distance > 0 ? -contact.distance / length : std::max(-contact.distance * push, 0.0);
  const double speed = apart - mocap_.separation(contact) / length;
  for (int row = first; row < first + count; ++row) {
    // Friction acts only if the bodies touch. Otherwise only normal motion is stopped.
    const double aim = speed + (contact.distance > 0 ? now[row] - normal : 0.0);
    if (discrete)
      (*e_.efc_margin)[row] = (*e_.efc_pos)[row] + length * aim;
    else
      (*e_.efc_aref)[row] = (aim - now[row]) / length;
  }
}

}  // namespace tauguard::contacts
