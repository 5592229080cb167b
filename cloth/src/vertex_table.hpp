// The vertices that a list of features uses, and the rank of each among them. The memory depends on
// the number of vertices in use, not on the largest index.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace tauguard::cloth {

// Whether a table of all indices up to `largest` is not much longer than a list of `size` entries.
inline bool dense(std::size_t largest, std::size_t size) { return largest <= 8 * size + 1024; }

// The vertices in use, sorted and unique.
inline std::vector<std::int32_t> used_vertices(const std::vector<std::int32_t>& list) {
  std::vector<std::int32_t> used;
  if (list.empty()) return used;
  const std::size_t largest = *std::max_element(list.begin(), list.end());
  if (dense(largest, list.size())) {
    std::vector<std::uint8_t> seen(largest + 1, 0);
    for (const auto v : list) seen[v] = 1;
    for (std::size_t v = 0; v <= largest; ++v)
      if (seen[v]) used.push_back(static_cast<std::int32_t>(v));
    return used;
  }
  used = list;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  return used;
}

class VertexTable {
 public:
  // used: sorted and unique; must outlive the table.
  explicit VertexTable(const std::vector<std::int32_t>& used) : used_(used) {
    if (used.empty() || !dense(used.back(), used.size())) return;
    place_.assign(std::size_t(used.back()) + 1, -1);
    for (std::size_t i = 0; i < used.size(); ++i) place_[used[i]] = static_cast<std::int32_t>(i);
  }
  // The rank of a vertex that is in use.
  std::int32_t place(std::int32_t v) const {
    if (!place_.empty()) return place_[v];
    return static_cast<std::int32_t>(std::lower_bound(used_.begin(), used_.end(), v) -
                                     used_.begin());
  }

 private:
  const std::vector<std::int32_t>& used_;
  std::vector<std::int32_t> place_;
};

}  // namespace tauguard::cloth
