// The guarded step. A step of MuJoCo is rolled back if a pair goes too deep or separates unnoticed,
// or if contacts add too much energy. Sub-steps that stop the approach repeat it (rows.hpp).
#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <unordered_map>

#include "energy_budget.hpp"
#include "impact_zone.hpp"
#include "rows.hpp"
#include "verdict.hpp"

namespace tauguard::contacts {

// A pair whose eroded shapes meet in a step, or that touches and separates in it. Level k erodes by
// a depth that grows with k (verdict.hpp). For a flex, `time` is the earliest time and `deepest`
// the deepest level over its simplices.
struct PairHit {
  int pair, deepest;  // number of the pair; deepest level whose eroded shapes met
  bool passed;        // the eroded shapes of the last level met: the pair would have passed through
  bool lost;          // even these shapes overlap at the start of the step: no longer guarded
  bool brushed;       // the pair touched and separated within the step; no eroded shapes met
  double time;        // first touch, as a fraction of the step; 0 if the pair touched at the start
  double way;         // upper bound on how far the two shapes approach each other in the step [m]
  std::vector<std::int32_t> features;  // deepest simplices of the flex
  std::vector<std::int32_t> corners;   // of a pair of flexes: the vertices that crossed
};

// A sub-step that was rolled back: the end time of the next attempt [s], and the pair that caused
// the rollback.
struct Cut {
  double time;
  int pair;
};

// The report of a step.
struct Report {
  int steps = 1, contacts = 0;
  std::vector<Cut> cuts;
  std::vector<int> passed, impact_zones;
  double added = 0, standstill = 0;
  bool rolled_back = false;
  bool unaided = false;  // memory was too small for the contacts of a sub-step
};

// SETTINGS and GuardedStepper in contacts/guard/stepper.py explain the fields.
struct Settings {
  int most;
  double beyond, room, smallest;
  int watched, look;
  double deeper_geom, deeper_flex, turned, allowed;
  TAUGUARD_FIELDS(most, beyond, room, smallest, watched, look, deeper_geom, deeper_flex, turned,
                  allowed)
};

// What a guard covers.
struct Coverage {
  Verdict verdict;
  std::vector<Partners> pairs;
  std::vector<int> last_level;  // of every pair
  std::vector<Sheet> sheets;
  std::vector<int> spins;    // rotational degrees of freedom
  std::vector<char> pulled;  // equalities, as in mocap.hpp
};

class Stepper {
 public:
  // Appends the pairs of flexes that cross in a step.
  using TunnellingEvents = std::function<void(std::vector<PairHit>*)>;

  Stepper(const Engine& engine, Coverage covered, const Settings& settings);

  const Report& report() const { return report_; }
  const std::vector<double>& first() const { return first_; }
  const std::vector<double>& vertices() const { return x_t1_; }
  // Whether an error of MuJoCo comes from a user's callback, and not from MuJoCo.
  void set_interrupted(std::function<bool()> asked) { interrupted_ = std::move(asked); }
  void set_tunnelling(TunnellingEvents tunnelling) { tunnelling_ = std::move(tunnelling); }
  // Advances by one timestep; `each` is called after every sub-step. Returns true if the number of
  // contacts is all that the report contains.
  bool step(const std::function<void()>& each);
  std::vector<int> sunk() const { return verdict_.sunk_pairs(); }
  // Clears the memory of earlier steps, after the user has set the state.
  void reset();
  // Replaces the covered pairs. The memory of pairs that remain is kept.
  void follow(Coverage covered);
  // Whether the guard can step the model and the data.
  bool acceptable() const;
  // Restores the state at the start of the step, after an exception.
  void abandon();
  // Writes or reads the memory of earlier steps.
  template <class Archive>
  void archive(Archive& a) {
    verdict_.archive(a), mocap_.archive(a), budget_.archive(a);
    a(guarded_), a(guarded_count_), a(watched_), a(since_), a(contacts_), a(stops_);
  }
  // A model for callbacks (model_copy.hpp).
  void bind(void* model) { rows_.bind(model); }

 private:
  void accept_step();
  std::vector<PairHit> judge(Depth depth = Depth::all);
  bool finite() const;
  void number_pairs();
  void roll_back(std::vector<PairHit> hits, bool fresh, const std::function<void()>& each);
  bool advance(double length);
  double sub_step(double length, const std::function<void()>& each);
  EnergyChange last_resort(double length, const std::vector<PairHit>& hits, EnergyChange change);
  double join(const std::vector<PairHit>& through, double length);
  void move(double length);
  double shorter(const std::vector<PairHit>& hits, double length);
  bool tolerable(const std::vector<PairHit>& hits, double length) const;
  void note_lost(const std::vector<PairHit>& hits);
  void note_reset();
  std::vector<PairHit> unseen(std::vector<PairHit> hits);
  bool within_budget();
  void note_passed();
  bool passes();
  void carry();
  const double* turns();
  std::vector<char> listed() const;
  void release();
  std::vector<Held> held(double length) const;

  Engine e_;
  std::vector<Partners> pairs_;
  std::vector<int> last_level_;
  Settings s_;
  Verdict verdict_;
  Mocap mocap_;
  EnergyBudget budget_;
  Rows rows_;
  TunnellingEvents tunnelling_;
  std::function<bool()> interrupted_;
  std::unordered_map<std::uint64_t, int> number_;  // the number of a pair, by its partners
  std::vector<int> spins_;                         // rotational degrees of freedom

  bool stepping_ = false;  // first_ contains the state at the start of the step
  std::vector<double> first_, saved_, velocity_, qpos_, x_t1_, turn_;
  std::vector<char> guarded_;
  int guarded_count_ = 0, watched_ = 0, since_ = 0, contacts_ = 0;

  // State of a step while it is repeated in sub-steps.
  Report report_;
  double whole_ = 0, rest_ = 0;   // whole and remaining time [s]
  double push_ = 0;               // rate at which overlaps are pushed out [1/s]
  int contacts_allowed_ = 0;      // in a sub-step
  double length_ = 0;             // duration of the present attempt [s]
  double least_ = 0;              // smallest sub-step, as a fraction of the step
  int stops_ = 0;                 // number of impact zones in the last step that was rolled back
  std::map<int, double> speeds_;  // held pairs; bound on the speed of their approach [m/s]
  std::vector<char> passed_, in_zone_;
};

}  // namespace tauguard::contacts
