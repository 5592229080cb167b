// The guarded step: plain where that holds, redone in pieces with the approach stopped.
#pragma once

#include <cmath>
#include <functional>
#include <unordered_map>

#include "account.hpp"
#include "rows.hpp"
#include "verdict.hpp"

namespace tauguard::contacts {

// What a step would do to a pair; of the simplices of a flex the earliest and the deepest count.
struct PairHit {
  int pair, deepest;
  bool passed;   // its last cores met: the pair would have passed through itself
  bool lost;     // they met at the start already, and had been apart: it is followed no longer
  bool brushed;  // it touched and parted again within the step, no cores met
  double time;   // when it first touches, as a share of the step; 0 if it did at the start
  double way;    // no two of its points approach each other further in the step [m]
  std::vector<std::int32_t> features;  // simplices of the flex that came deepest
  std::vector<std::int32_t> corners;   // of flexes against flexes: vertices that did
};

// One attempt at a piece of a step that was taken back: when the next ends [s], the pair, and
// whether its parameters were changed for it.
struct Cut {
  double time;
  int pair;
  bool stiffened;
};

// What one step did, beside the number of contacts.
struct Report {
  int steps = 1, contacts = 0;
  std::vector<Cut> cuts;
  std::vector<int> restored, passed, arrested;
  double added = 0;
  bool redone = false;
};

struct Settings {
  bool stiff;
  int most;           // calls of mj_step that one step may cost
  double beyond;      // how far beyond the touch a cut piece goes [m]
  double room;        // margins over what the pair travelled in the attempt that failed
  double smallest;    // least share of a step that is a piece
  double push;        // share of a depth that a piece may push out for each step that it lasts
  int watched, look;  // steps that energy is counted after a redone one; parted pairs are looked up
  double deeper_geom, deeper_flex;  // pieces above this share of a step may not deepen a held pair
  double turned;                    // rotation in a step above which whole turns are counted [rad]
};

class Stepper {
 public:
  // Flexes against flexes: what crosses between two sets of vertices.
  using Crossings = std::function<void(std::vector<PairHit>*)>;
  // Stops partners of what passed in the piece just tried, from `qpos` on.
  struct Stopped {
    std::vector<int> pairs;
    double work;  // that mocap bodies did by it [J]
  };
  using Arrest = std::function<Stopped(const std::vector<PairHit>&, const double*, double)>;

  Stepper(const Engine& engine, Verdict verdict, std::vector<Partners> pairs,
          std::vector<int> last_level, std::vector<Sheet> sheets, std::vector<int> spins,
          std::vector<char> pulled, const Settings& settings, double allowed);

  const Report& report() const { return report_; }
  const std::vector<double>& first() const { return first_; }
  const std::vector<double>& vertices() const { return x_t1_; }
  void set_callbacks(Crossings crossings, Arrest arrest) {
    crossings_ = std::move(crossings), arrest_ = std::move(arrest);
  }
  // Advance by one timestep; `each` is called after every piece. True if all is in the number of
  // contacts, or there is a report.
  bool step(const std::function<void()>& each);
  std::vector<PairHit> judge();
  // Put every contact parameter back.
  void close();
  // The state was set anew: nothing is known from the steps before.
  void reset();
  std::vector<int> stiffened() const;

 private:
  bool stands();
  void redo(std::vector<PairHit> hits, bool fresh, const std::function<void()>& each);
  double piece(double length, const std::function<void()>& each);
  Entry last_resort(double length, const std::vector<PairHit>& hits, Entry entry);
  double shorter(const std::vector<PairHit>& hits, double length);
  bool bearable(const std::vector<PairHit>& hits, double length) const;
  void note_lost(const std::vector<PairHit>& hits);
  void note_reset();
  std::vector<PairHit> unseen(std::vector<PairHit> hits);
  bool solvent();
  void note_passed();
  bool passes();
  void carry();
  const double* turns();
  std::vector<char> listed() const;
  std::vector<int> release();
  std::vector<Held> held(double length) const;

  Engine e_;
  std::vector<Partners> pairs_;
  std::vector<int> last_level_;
  Settings s_;
  Verdict verdict_;
  Mocap mocap_;
  Account account_;
  Stiffening stiffening_;
  Rows rows_;
  Crossings crossings_;
  Arrest arrest_;
  std::unordered_map<std::uint64_t, int> number_;  // of a pair, by its partners
  std::vector<int> spins_;                         // degrees of freedom that turn something

  std::vector<double> first_, saved_, velocity_, qpos_, x_t1_, turn_;
  std::vector<char> guarded_;
  int guarded_count_ = 0, watched_ = 0, since_ = 0, contacts_ = 0;

  // Of the step being redone.
  Report report_;
  double whole_ = 0, rest_ = 0, push_ = 0;  // of time [s]; of depth [1/s]
  double least_ = 0;                        // share of the step that is not cut
  int stops_ = 0;                           // of partners, in the last step that was redone
  std::map<int, double> speeds_;            // of the pairs that are held [m/s]
  std::vector<char> passed_, arrested_;
};

}  // namespace tauguard::contacts
