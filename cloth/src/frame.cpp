#include "frame.hpp"

#include <algorithm>
#include <chrono>

#include "tauguard/geometry/rounding.hpp"

namespace tauguard::cloth {
namespace {

using Instant = std::chrono::steady_clock::time_point;

double seconds(Instant from, Instant to) { return std::chrono::duration<double>(to - from).count(); }

// Where a collision lies before sorting.
struct Place {
  std::uint64_t key;
  std::uint32_t part, index;
};

// What the narrow phase writes for a block of candidates.
struct Answers {
  static constexpr std::size_t n = CandidateBlock::capacity;
  std::vector<std::uint8_t> hit = std::vector<std::uint8_t>(n);
  std::vector<double> toi = std::vector<double>(n), point = std::vector<double>(3 * n),
                      normal = std::vector<double>(3 * n), weights = std::vector<double>(4 * n);
};

template <class T>
void append(std::vector<T>& to, const T* from, std::size_t n) {
  to.insert(to.end(), from, from + n);
}

void append_row(Collisions& to, const std::int32_t* pair, const double* toi, const double* point,
                const double* normal, const double* weights) {
  append(to.pairs, pair, 2);
  append(to.toi, toi, 1);
  append(to.point, point, 3);
  append(to.normal, normal, 3);
  append(to.weights, weights, 4);
}

// One list in the order of the pairs. A pair occurs once, so that the order is unique.
Collisions sorted(const std::vector<Collisions>& parts) {
  Collisions all;
  std::vector<Place> places;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    for (std::size_t i = 0; i < parts[p].size(); ++i) {
      const std::int32_t* pair = &parts[p].pairs[2 * i];
      const auto key = std::uint64_t(std::uint32_t(pair[0])) << 32 | std::uint32_t(pair[1]);
      places.push_back({key, std::uint32_t(p), std::uint32_t(i)});
    }
    all.stats += parts[p].stats;
    all.narrow_s += parts[p].narrow_s;
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.key < b.key; });
  all.pairs.reserve(2 * places.size());
  all.toi.reserve(places.size());
  all.point.reserve(3 * places.size());
  all.normal.reserve(3 * places.size());
  all.weights.reserve(4 * places.size());
  for (const auto& at : places) {
    const Collisions& c = parts[at.part];
    append_row(all, &c.pairs[2 * at.index], &c.toi[at.index], &c.point[3 * at.index],
               &c.normal[3 * at.index], &c.weights[4 * at.index]);
  }
  return all;
}

}  // namespace

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, const double* x_t0, const double* x_t1,
                           Method method, double min_distance) {
  std::vector<Collisions> parts(ccd.chunks(kind));
  const auto start = std::chrono::steady_clock::now();
  ccd.for_each_block(kind, [&](const CandidateBlock& block, std::size_t chunk) {
    const geometry::RoundToNearest guard;  // of this thread
    static thread_local Answers answers;
    Collisions& part = parts[chunk];
    const auto begin = std::chrono::steady_clock::now();
    const auto solve = kind == MeshCcd::Kind::vf ? solve_vf : solve_ee;
    solve(x_t0, x_t1, block.rows.data(), block.size, method, min_distance, answers.hit.data(),
          {answers.toi.data(), answers.point.data(), answers.normal.data(), answers.weights.data()},
          part.stats, {!ccd.volume().moving});  // what moves has been seen from x, y and z
    for (std::size_t i = 0; i < block.size; ++i)
      if (answers.hit[i])
        append_row(part, &block.pairs[2 * i], &answers.toi[i], &answers.point[3 * i],
                   &answers.normal[3 * i], &answers.weights[4 * i]);
    part.narrow_s += seconds(begin, std::chrono::steady_clock::now());
  });
  Collisions all = sorted(parts);
  all.total_s = seconds(start, std::chrono::steady_clock::now());
  return all;
}

}  // namespace tauguard::cloth
