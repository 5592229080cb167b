#include "stiffening.hpp"

#include <algorithm>

namespace tauguard::contacts {

bool Stiffening::stiffen(int pair) {
  if (stiff_[pair]) return false;
  stiff_[pair] = 1;
  const Partners& p = pairs_[pair];
  const Place at = p.carrier;
  double *own_solref = e_.solref[at.kind] + 2 * at.number,
         *own_solimp = e_.solimp[at.kind] + 5 * at.number;
  int* own_priority = e_.priority[at.kind] ? e_.priority[at.kind] + at.number : nullptr;
  const auto [entry, fresh] = saved_.try_emplace(at);
  Saved& saved = entry->second;
  if (fresh) {
    std::copy_n(own_solref, 2, saved.solref.begin());
    std::copy_n(own_solimp, 5, saved.solimp.begin());
    saved.priority = own_priority ? *own_priority : 0;
    saved.users = 0;
  }
  ++saved.users;
  std::copy(solref.begin(), solref.end(), own_solref);
  std::copy(solimp.begin(), solimp.end(), own_solimp);
  if (own_priority) {
    const Place& other = p.first == at ? p.second : p.first;
    *own_priority = std::max(*own_priority, e_.priority[other.kind][other.number] + 1);
    saved.raised = *own_priority;
  }
  return true;
}

void Stiffening::follow() {
  const auto one = [](auto* now, auto stiff, auto* saved) {
    if (*now != stiff) *saved = *now, *now = stiff;
  };
  for (auto& [at, saved] : saved_) {
    for (int k = 0; k < 2; ++k)
      one(e_.solref[at.kind] + 2 * at.number + k, solref[k], &saved.solref[k]);
    for (int k = 0; k < 5; ++k)
      one(e_.solimp[at.kind] + 5 * at.number + k, solimp[k], &saved.solimp[k]);
    if (e_.priority[at.kind]) one(e_.priority[at.kind] + at.number, saved.raised, &saved.priority);
  }
}

bool Stiffening::restore(int pair) {
  if (!stiff_[pair]) return false;
  stiff_[pair] = 0;
  const auto entry = saved_.find(pairs_[pair].carrier);
  const Place at = entry->first;
  const Saved& saved = entry->second;
  if (--entry->second.users > 0) return true;
  std::copy_n(saved.solref.begin(), 2, e_.solref[at.kind] + 2 * at.number);
  std::copy_n(saved.solimp.begin(), 5, e_.solimp[at.kind] + 5 * at.number);
  if (e_.priority[at.kind]) e_.priority[at.kind][at.number] = saved.priority;
  saved_.erase(entry);
  return true;
}

}  // namespace tauguard::contacts
