// Changes contact parameters while a guarded contact lasts, and restores them after it.
#pragma once

#include <array>
#include <map>

#include "engine.hpp"

namespace tauguard::contacts {

// An object with contact parameters: an explicit pair, a geom or a flex, and its number.
struct Place {
  enum Kind { pair, geom, flex } kind;
  int number;
  bool operator<(const Place& o) const {
    return kind != o.kind ? kind < o.kind : number < o.number;
  }
  bool operator==(const Place& o) const { return kind == o.kind && number == o.number; }
};

// Both partners of a contact (flexes first), and the object whose parameters are changed.
struct Partners {
  Place first, second, carrier;
};

class Stiffening {
 public:
  // Stiff contact parameters: a fast body sinks in by less than its own radius.
  static constexpr std::array<double, 2> solref = {1e-4, 1.0};
  static constexpr std::array<double, 5> solimp = {0.99, 0.999, 0.001, 0.5, 2.0};

  Stiffening(const Engine& engine, const std::vector<Partners>& pairs)
      : e_(engine), pairs_(pairs), stiff_(pairs.size(), 0) {}

  // Makes a pair stiff. `carrier` gets a higher priority than the other partner, so that MuJoCo
  // does not average the parameters. False if the pair was stiff already.
  bool stiffen(int pair);
  // Restores the parameters once no other pair needs them stiff. False if the pair was not stiff.
  bool restore(int pair);
  bool is_stiff(int pair) const { return stiff_[pair]; }
  // Stores values that the user has written meanwhile; they are restored later.
  void follow();
  // Starts with a new list of pairs, none of them stiff.
  void resize() { stiff_.assign(pairs_.size(), 0), saved_.clear(); }
  template <class Archive>
  void archive(Archive& a) {
    a(stiff_);
    std::vector<Entry> entries(saved_.begin(), saved_.end());
    archive_entries(a, &entries);
    saved_ = {entries.begin(), entries.end()};
  }

 private:
  struct Saved {
    std::array<double, 2> solref;
    std::array<double, 5> solimp;
    int priority, users;
    int raised;  // the priority that the guard has written
  };
  using Entry = std::pair<Place, Saved>;
  template <class Archive>
  static void archive_entries(Archive& a, std::vector<Entry>* entries) {
    std::size_t count = entries->size();
    a(count);
    entries->resize(count, {Place{Place::geom, 0}, Saved{}});
    for (Entry& e : *entries) {
      a(e.first), a(e.second.solref), a(e.second.solimp);
      a(e.second.priority), a(e.second.users), a(e.second.raised);
    }
  }
  const Engine& e_;
  const std::vector<Partners>& pairs_;
  std::vector<char> stiff_;
  std::map<Place, Saved> saved_;
};

}  // namespace tauguard::contacts
