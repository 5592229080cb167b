#include "stepper.hpp"

#include <algorithm>
#include <limits>

namespace tauguard::contacts {
namespace {

std::uint64_t key(const Place& first, const Place& second) {
  const auto one = [](const Place& p) {
    return static_cast<std::uint64_t>(p.number) << 1 | (p.kind == Place::geom ? 1u : 0u);
  };
  return one(first) << 32 | one(second);
}

// A key of the partners of a contact, in the order of pairs: flexes first, then the lower number.
std::uint64_t key(const Contact& contact) {
  Place p[2];
  for (int i = 0; i < 2; ++i)
    p[i] = contact.geom[i] >= 0 ? Place{Place::geom, contact.geom[i]}
                                : Place{Place::flex, contact.flex[i]};
  const bool swap = p[0].kind != p[1].kind ? p[0].kind == Place::geom : p[0].number > p[1].number;
  return swap ? key(p[1], p[0]) : key(p[0], p[1]);
}

std::vector<int> marked(const std::vector<char>& marks) {
  std::vector<int> out;
  for (std::size_t i = 0; i < marks.size(); ++i)
    if (marks[i]) out.push_back(static_cast<int>(i));
  return out;
}

// Restores the mocap poses when it is destroyed, also by an exception.
struct Back {
  Mocap& mocap;
  ~Back() { mocap.command(); }
};

}  // namespace

Stepper::Stepper(const Engine& engine, Coverage covered, const Settings& settings)
    : e_(engine),
      pairs_(std::move(covered.pairs)),
      last_level_(std::move(covered.last_level)),
      s_(settings),
      verdict_(std::move(covered.verdict)),
      mocap_(e_, std::move(covered.pulled)),
      budget_(e_, mocap_, std::move(covered.sheets), settings.allowed),
      rows_(e_, pairs_, mocap_),
      spins_(std::move(covered.spins)),
      first_(engine.state_size),
      saved_(engine.state_size),
      velocity_(engine.nv),
      qpos_(engine.nq),
      x_t1_(3 * static_cast<std::size_t>(engine.nflexvert)),
      turn_(3 * static_cast<std::size_t>(engine.nbody)),
      guarded_(pairs_.size(), 0),
      passed_(pairs_.size(), 0),
      in_zone_(pairs_.size(), 0) {
  number_pairs();
}

void Stepper::number_pairs() {
  number_.clear();
  for (std::size_t i = 0; i < pairs_.size(); ++i)
    number_[key(pairs_[i].first, pairs_[i].second)] = static_cast<int>(i);
}

void Stepper::follow(Coverage covered) {
  struct Before {
    std::vector<char> known;
    bool guarded;
  };
  std::unordered_map<std::uint64_t, Before> before;
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    before[key(pairs_[i].first, pairs_[i].second)] = {verdict_.known(i), guarded_[i] != 0};
  }
  verdict_ = std::move(covered.verdict), pairs_ = std::move(covered.pairs);
  last_level_ = std::move(covered.last_level), spins_ = std::move(covered.spins);
  budget_.set_sheets(std::move(covered.sheets)), mocap_.set_pulled(std::move(covered.pulled));
  guarded_count_ = 0;
  number_pairs();
  for (std::vector<char>* marks : {&guarded_, &passed_, &in_zone_}) marks->assign(pairs_.size(), 0);
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const auto found = before.find(key(pairs_[i].first, pairs_[i].second));
    if (found == before.end()) continue;
    verdict_.set_known(i, found->second.known);
    guarded_[i] = found->second.guarded, guarded_count_ += guarded_[i];
  }
}

bool Stepper::acceptable() const {
  const double h = *e_.timestep;
  return h > 0 && h <= std::numeric_limits<double>::max() && !(*e_.enableflags & e_.refused) &&
         *e_.integrator != e_.runge_kutta &&
         (*e_.cone == e_.pyramidal || *e_.cone == e_.elliptic) &&
         !(e_.contact_filter && *e_.contact_filter) && mocap_.finite();
}

void Stepper::abandon() {
  if (!stepping_) return;
  stepping_ = false;
  e_.set_state(e_.model, e_.data, first_.data(), e_.signature.integration);
}

bool Stepper::finite() const {
  double sum = 0;
  for (int i = 0; i < e_.nq; ++i) sum += e_.qpos[i] - e_.qpos[i];
  for (int i = 0; i < e_.nv; ++i) sum += e_.qvel[i] - e_.qvel[i];
  return sum == 0;
}

bool Stepper::step(const std::function<void()>& each) {
  if (!mocap_.begin()) verdict_.forget();
  e_.get_state(e_.model, e_.data, first_.data(), e_.signature.integration);
  stepping_ = true;
  const bool watched = watched_ > 0;
  if (watched) std::copy_n(e_.qvel, e_.nv, velocity_.begin());
  whole_ = length_ = *e_.timestep;
  const double after = *e_.time + whole_;
  bool lost;
  {
    const ResetWatch watch(e_);
    e_.step(e_.model, e_.data);
    lost = watch.happened() || *e_.time != after || !finite();
  }
  std::vector<PairHit> hits = judge(Depth::none);
  std::fill(passed_.begin(), passed_.end(), 0);
  if (lost) note_reset();
  if (!hits.empty()) {
    for (const PairHit& hit : hits) lost = lost || hit.lost;
    note_lost(hits);
    hits = unseen(std::move(hits));
  }
  report_ = Report{};
  if (hits.empty() && (!watched || within_budget())) {
    report_.contacts = *e_.ncon;
    accept_step();
    if (lost) report_.passed = marked(passed_);
    mocap_.remember();
    stepping_ = false;
    return !lost;
  }
  watched_ = s_.watched;
  {
    const Back back{mocap_};
    roll_back(std::move(hits), !watched, each);
  }
  mocap_.remember();
  stepping_ = false;
  return false;
}

// Accepts the plain step.
void Stepper::accept_step() {
  watched_ = std::max(watched_ - 1, 0);
  if (!guarded_count_) return;
  ++since_;
  if (*e_.ncon == contacts_ && since_ < s_.look) return;
  since_ = 0, contacts_ = *e_.ncon;
  release();
}

std::vector<PairHit> Stepper::judge(Depth depth) {
  e_.copy_state(e_.model, e_.data, e_.end, e_.signature.pose);
  e_.kinematics(e_.model, e_.end);
  if (e_.nflex) carry();
  std::vector<Hit> rows;
  const Poses poses{mocap_.xpos(), mocap_.xmat(), e_.end_xpos, e_.end_xmat, turns()};
  verdict_.judge(poses, mocap_.flexvert(), x_t1_.data(), depth, &rows);
  std::vector<PairHit> hits;
  for (const Hit& row : rows) {
    const int last = last_level_[row.pair];
    if (hits.empty() || hits.back().pair != row.pair)
      hits.push_back({row.pair, -1, false, false, true, INFINITY, 0, {}, {}});
    PairHit& hit = hits.back();
    if (row.deepest > last) {
      hit.lost = true;
      continue;
    }
    if (row.deepest > hit.deepest) hit.deepest = row.deepest, hit.features.clear();
    if (row.deepest == hit.deepest) hit.features.push_back(row.feature);
    hit.passed = hit.deepest == last;
    hit.brushed = hit.brushed && row.level == 0;
    hit.time = std::min(hit.time, row.t), hit.way = std::max(hit.way, row.way);
  }
  if (tunnelling_) tunnelling_(&hits);
  return hits;
}

// Rotation vectors of the bodies over the step, estimated from the velocity at its end; nullptr if
// all are slow.
const double* Stepper::turns() {
  double most = 0;
  const double h = length_;
  for (const int dof : spins_) most = std::max(most, std::fabs(e_.qvel[dof]));
  if (!(most * h > s_.turned)) return nullptr;
  std::copy_n(e_.qvel, e_.nv, e_.end_qvel);
  e_.com_pos(e_.model, e_.end), e_.com_vel(e_.model, e_.end);
  for (int b = 0; b < e_.nbody; ++b)
    for (int k = 0; k < 3; ++k) turn_[3 * b + k] = h * e_.end_cvel[6 * b + k];
  mocap_.add_turns(turn_.data());
  return turn_.data();
}

// Computes the vertices of flexes at the end of the step, with MuJoCo's order of sums.
void Stepper::carry() {
  if (e_.interpolated) {
    e_.com_pos(e_.model, e_.end), e_.flex(e_.model, e_.end);
    std::copy_n(e_.end_flexvert_xpos, x_t1_.size(), x_t1_.begin());
    return;
  }
  for (int i = 0; i < e_.nflexvert; ++i) {
    const int body = e_.flex_vertbodyid[i];
    const double *at = e_.end_xpos + 3 * body, *r = e_.end_xmat + 9 * body,
                 *v = e_.flex_vert + 3 * i;
    const bool origin = v[0] == 0 && v[1] == 0 && v[2] == 0;
    for (int k = 0; k < 3; ++k)
      x_t1_[3 * i + k] =
          origin ? at[k] : r[3 * k] * v[0] + r[3 * k + 1] * v[1] + r[3 * k + 2] * v[2] + at[k];
  }
}

// MuJoCo has reset the data because of bad numbers, so any pair may have passed through.
void Stepper::note_reset() { std::fill(passed_.begin(), passed_.end(), 1); }

void Stepper::note_lost(const std::vector<PairHit>& hits) {
  for (const PairHit& hit : hits)
    if (hit.lost) passed_[hit.pair] = 1;
}

// Removes hits of pairs that are no longer guarded. Also removes pairs that touched and separated
// within the step if MuJoCo listed a contact of the pair.
std::vector<PairHit> Stepper::unseen(std::vector<PairHit> hits) {
  const auto gone = [](const PairHit& hit) { return hit.time == INFINITY; };
  hits.erase(std::remove_if(hits.begin(), hits.end(), gone), hits.end());
  if (std::none_of(hits.begin(), hits.end(), [](const PairHit& h) { return h.brushed; }))
    return hits;
  const std::vector<char> seen = listed();
  const auto known = [&](const PairHit& hit) { return hit.brushed && seen[hit.pair]; };
  hits.erase(std::remove_if(hits.begin(), hits.end(), known), hits.end());
  return hits;
}

// Whether a plain step is within the energy budget; if so, its change is recorded.
bool Stepper::within_budget() {
  const EnergyChange change = budget_.change(velocity_.data(), *e_.timestep, x_t1_.data());
  if (budget_.exceeded(change)) return false;
  budget_.record(change);
  return true;
}

// For each pair, whether MuJoCo lists a contact.
std::vector<char> Stepper::listed() const {
  std::vector<char> seen(pairs_.size(), 0);
  for (int k = 0; k < *e_.ncon; ++k) {
    const auto found = number_.find(key(e_.contact_at(k)));
    if (found != number_.end()) seen[found->second] = 1;
  }
  return seen;
}

// Releases the pairs that have separated.
void Stepper::release() {
  if (!guarded_count_) return;
  const std::vector<char> seen = listed();
  for (std::size_t i = 0; i < guarded_.size(); ++i) {
    // Pairs with a moving mocap body are always released: in a whole step the mocap body sinks into
    // other bodies, so a pair that is held would be ejected.
    if (guarded_[i] && (!seen[i] || mocap_.carries(pairs_[i]))) guarded_[i] = 0, --guarded_count_;
  }
}

void Stepper::reset() {
  std::fill(guarded_.begin(), guarded_.end(), 0);
  guarded_count_ = watched_ = 0;
  verdict_.forget();
  mocap_.remember();
}

}  // namespace tauguard::contacts
