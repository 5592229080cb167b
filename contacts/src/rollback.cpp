// Rolls back a step that was not accepted, and repeats it in sub-steps.
#include <algorithm>
#include <cmath>

#include "stepper.hpp"

namespace tauguard::contacts {
namespace {

// Factors of the velocity, tried in turn until the sub-step is within the energy budget.
constexpr double slower[] = {0.7, 0.5, 0.25, 0.1, 0.0};

// If only an impact zone helps, short sub-steps are useless. So each impact zone multiplies the
// length of the shortest sub-step by `longer`, up to the fraction `longest` of a step. After a step
// with an impact zone, the next one that is rolled back begins with sub-steps of this length,
// unless more than `watched` steps were accepted between them.
constexpr double longer = 4, longest = 0.25;

// Speed at which overlaps are pushed out, divided by the depth [1/s]: the largest at which a
// critically damped contact with the time constant 0.02 s, released at rest, separates. Mocap
// bodies push out faster: the fraction `pushed` of the depth in each step.
const double recovery = 1 / (0.02 * M_E);
constexpr double pushed = 0.2;

// A sub-step may have `more` times the contacts of the plain step, and `few` in addition.
constexpr int more = 4, few = 1000;

// Largest number of attempts to find all pairs of an impact zone.
constexpr int rounds = 8;

}  // namespace

// `fresh` starts a new energy budget.
void Stepper::roll_back(std::vector<PairHit> hits, bool fresh, const std::function<void()>& each) {
  report_.rolled_back = true;
  std::fill(in_zone_.begin(), in_zone_.end(), 0);
  speeds_.clear();
  contacts_allowed_ = more * *e_.ncon + few;
  e_.set_state(e_.model, e_.data, first_.data(), e_.signature.integration);
  if (fresh) budget_.open(e_.qvel);
  const double end = *e_.time + whole_;
  // No hits: contacts added too much energy, so nothing is pushed out.
  push_ = hits.empty() ? 0 : mocap_.moves() ? std::max(pushed / whole_, recovery) : recovery;
  for (std::size_t i = 0; hits.empty() && i < guarded_.size(); ++i)
    if (guarded_[i]) speeds_[static_cast<int>(i)] = 0;
  const bool stuck = !fresh && stops_ > 0;
  least_ = stuck ? longest : s_.smallest;
  stops_ = 0;
  double length = shorter(hits, whole_);
  if (stuck) length = std::min(length, longest * whole_);
  for (Cut& cut : report_.cuts) cut.time = std::min(cut.time, *e_.time + length);
  for (rest_ = whole_; rest_ > 0;) {
    const int stops = stops_;
    length = sub_step(std::min(length, rest_), each);
    rest_ = length < rest_ * (1 - 1e-9) ? rest_ - length : 0;
    length = stops_ > stops ? least_ * whole_ : rest_;
  }
  *e_.time = end;
  release();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    if (passed_[i]) report_.passed.push_back(static_cast<int>(i));
    if (in_zone_[i]) report_.impact_zones.push_back(static_cast<int>(i));
  }
}

// Advances by at most `length`, in shorter attempts if one fails. Returns the time advanced [s].
double Stepper::sub_step(double length, const std::function<void()>& each) {
  const double share = 1 - rest_ / whole_;
  mocap_.sub_step(share, 1), mocap_.depart();
  e_.get_state(e_.model, e_.data, saved_.data(), e_.signature.integration);
  if (mocap_.moves()) e_.copy_state(e_.model, e_.data, e_.other, e_.signature.pose);
  std::copy_n(e_.qvel, e_.nv, velocity_.begin());
  std::copy_n(e_.qpos, e_.nq, qpos_.begin());
  const double begin = *e_.time;
  EnergyChange change{};
  rows_.unite(false);
  for (;;) {
    mocap_.sub_step(share, length < rest_ * (1 - 1e-9) ? share + length / whole_ : 1);
    const ResetWatch watch(e_);
    ++report_.steps;
    if (!advance(length)) {
      e_.set_state(e_.model, e_.data, saved_.data(), e_.signature.integration);
      length *= 0.25;
      continue;
    }
    if (watch.happened() || *e_.time != begin + length || !finite()) {
      note_reset();
      break;
    }
    mocap_.arrive();
    std::vector<PairHit> hits = judge();
    note_lost(hits);
    hits = unseen(std::move(hits));
    change = budget_.change(velocity_.data(), length, x_t1_.data());
    const bool fails = !tolerable(hits, length);
    if (!fails && !budget_.exceeded(change)) break;
    if (length <= least_ * whole_ || report_.steps >= s_.most) {
      if (fails && !e_.nflex && rows_.unite(true)) {
        e_.set_state(e_.model, e_.data, saved_.data(), e_.signature.integration);
        continue;
      }
      change = last_resort(length, hits, change);
      break;
    }
    e_.set_state(e_.model, e_.data, saved_.data(), e_.signature.integration);
    if (fails)
      length = shorter(hits, length);
    else if (push_ > 0)
      push_ = 0;
    else
      length *= 0.5;
  }
  report_.contacts = std::max(report_.contacts, *e_.ncon);
  budget_.record(change);
  report_.added += std::max(change.gain, 0.0);
  if (each) each();
  return length;
}

// One attempt of a sub-step. False if the contacts of held pairs need too much memory and a shorter
// attempt may need less; the shortest one is made without them.
bool Stepper::advance(double length) {
  length_ = length;
  const Stacks stacks(e_);
  try {
    if (rows_.step(saved_.data(), length, held(length), contacts_allowed_, push_)) return true;
  } catch (const MujocoError&) {
    if (interrupted_ && interrupted_()) throw;
    stacks.put_back();
  }
  if (length > least_ * whole_ && report_.steps < s_.most) return false;
  report_.unaided = true;
  e_.set_state(e_.model, e_.data, saved_.data(), e_.signature.integration);
  rows_.step(saved_.data(), length, {}, 0, 0);
  return true;
}

std::vector<Held> Stepper::held(double length) const {
  std::vector<Held> out;
  for (const auto& [pair, speed] : speeds_)
    out.push_back({pair, s_.room * speed * length + s_.beyond});
  return out;
}

// Whether the hits are acceptable: no pair passes through, every pair is held (rows.hpp), and the
// sub-step is already short.
bool Stepper::tolerable(const std::vector<PairHit>& hits, double length) const {
  return std::all_of(hits.begin(), hits.end(), [&](const PairHit& hit) {
    const bool rigid = pairs_[hit.pair].first.kind == Place::geom;
    const double share = rigid ? s_.deeper_geom : s_.deeper_flex;
    return !hit.passed && speeds_.count(hit.pair) && length <= share * whole_ * 1.000001;
  });
}

// Ends a step that has used all its attempts. Pairs that pass through are joined in impact zones.
// Then the motion is slowed down until it is within the energy budget.
EnergyChange Stepper::last_resort(double length, const std::vector<PairHit>& hits,
                                  EnergyChange change) {
  std::vector<PairHit> through;
  for (const PairHit& hit : hits)
    if (hit.passed) through.push_back(hit);
  double work = 0;
  const auto again = [&] {
    change = budget_.change(velocity_.data(), length, x_t1_.data());
    change.gain -= work;
  };
  if (!through.empty()) {
    work = join(through, length);
    ++stops_, least_ = std::min(longer * least_, longest);
    again();
  }
  const std::vector<double> whole(e_.qvel, e_.qvel + e_.nv);
  const auto go = [&](double share) {
    for (int i = 0; i < e_.nv; ++i) e_.qvel[i] = share * whole[i];
    move(length);
  };
  for (const double share : slower) {
    if (!budget_.exceeded(change)) break;
    for (const auto& [pair, speed] : speeds_) in_zone_[pair] = 1;
    go(share);
    if (share == 0) report_.standstill += length;
    if (passes() && share > 0) continue;
    again();
  }
  if (!mocap_.moves()) return change;
  // If a moving mocap body passes through a body that was slowed down, all bodies get their full
  // speed again: too much energy is the smaller error.
  if (passes()) go(1), note_passed(), again();
  return change;
}

// Repeats the sub-step with the present velocity.
void Stepper::move(double length) {
  std::copy(qpos_.begin(), qpos_.end(), e_.qpos);
  e_.integrate(e_.model, e_.qpos, e_.qvel, length);
}

// Repeats a sub-step so that no partners pass through each other: the pairs in `through`, and those
// that pass through on the new path, move rigidly together. If this does not help, all except mocap
// bodies stand still. Returns the work of mocap bodies [J].
double Stepper::join(const std::vector<PairHit>& through, double length) {
  ImpactZone zone(e_, mocap_, length);
  const auto add = [&](const std::vector<PairHit>& hits) {
    bool fresh = false, passes = false;
    for (const PairHit& hit : hits) {
      if (!hit.passed) continue;
      passes = true, in_zone_[hit.pair] = 1;
      const bool simplices = !hit.features.empty() && hit.features[0] >= 0;
      fresh |= zone.add(hit.pair, pairs_[hit.pair],
                        simplices ? verdict_.vertices(hit.pair, hit.features) : hit.corners);
    }
    return std::pair(passes, fresh);
  };
  bool fresh = add(through).second;
  for (int round = 0; round < rounds && fresh; ++round) {
    double work = 0;
    if (!zone.join(&work)) break;
    move(length);
    const auto [passes, more] = add(judge());
    if (!passes) return work;
    fresh = more;
  }
  std::fill(e_.qvel, e_.qvel + e_.nv, 0.0);
  std::copy(qpos_.begin(), qpos_.end(), e_.qpos);
  report_.standstill += length;
  return 0;
}

// Marks the pairs that pass through between the start and the present state.
void Stepper::note_passed() {
  for (const PairHit& hit : judge())
    if (hit.passed) passed_[hit.pair] = 1;
}

bool Stepper::passes() {
  const std::vector<PairHit> hits = judge();
  return std::any_of(hits.begin(), hits.end(), [](const PairHit& h) { return h.passed; });
}

// The length of the next attempt. From now on the approach of the pairs in `hits` is stopped.
double Stepper::shorter(const std::vector<PairHit>& hits, double length) {
  double share = 1;
  bool fresh = false;
  for (const PairHit& hit : hits) {
    const auto [entry, first] = speeds_.try_emplace(hit.pair, 0.0);
    fresh = fresh || first;
    entry->second = std::max(entry->second, hit.way / length);
    if (first && pairs_[hit.pair].first.kind == Place::geom && hit.time > 0)
      share = std::min(share, hit.time + s_.beyond / std::max(hit.way, s_.beyond));
  }
  if (!fresh && !hits.empty()) share = 0.5;
  for (const PairHit& hit : hits) {
    if (!guarded_[hit.pair]) guarded_[hit.pair] = 1, ++guarded_count_;
    report_.cuts.push_back({*e_.time + share * length, hit.pair});
  }
  return std::max(share * length, std::min(length, 0.5 * s_.smallest * whole_));
}

}  // namespace tauguard::contacts
