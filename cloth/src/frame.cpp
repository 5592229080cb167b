#include "frame.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <vector>

#include "apart.hpp"
#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/scratch.hpp"
#include "too_many.hpp"

namespace tauguard::cloth {
namespace {

using Instant = std::chrono::steady_clock::time_point;

double seconds(Instant from, Instant to) {
  return std::chrono::duration<double>(to - from).count();
}

// One collision before its point and normal are computed, and the collisions of one chunk of
// candidates.
struct Row {
  std::int32_t pair[2], vertices[4];
  double toi;
};
struct Part {
  std::vector<Row> rows;
  Stats stats;
  double narrow_s = 0;
};

// Where a collision lies before sorting.
struct Place {
  std::uint64_t key;
  const Row* row;
};

// Radix sort by key, from the last digit.
void sort(std::vector<Place>& places) {
  constexpr int digit = 11;
  std::vector<Place> other(places.size());
  std::uint64_t used = 0;
  for (const auto& at : places) used |= at.key;
  for (int shift = 0; shift < 64 && used >> shift != 0; shift += digit) {
    const auto value = [shift](std::uint64_t key) { return key >> shift & ((1u << digit) - 1); };
    std::size_t start[(1 << digit) + 1] = {};
    for (const auto& at : places) ++start[value(at.key) + 1];
    for (int i = 0; i < 1 << digit; ++i) start[i + 1] += start[i];
    for (const auto& at : places) other[start[value(at.key)]++] = at;
    places.swap(other);
  }
}

// What the narrow phase writes for a block of candidates.
struct Answers {
  std::uint8_t hit[CandidateBlock::capacity];
  double toi[CandidateBlock::capacity];
};

// Sorts by pair. A pair occurs once, so that the order is unique.
std::vector<Place> in_order(const std::vector<Part>& parts) {
  std::size_t n = 0;
  std::uint32_t largest = 0;
  for (const auto& part : parts) {
    n += part.rows.size();
    for (const auto& row : part.rows) largest = std::max(largest, std::uint32_t(row.pair[1]));
  }
  // The second number gets no more bits than it needs, which leaves fewer digits to sort by.
  const int bits = largest == 0 ? 0 : 32 - __builtin_clz(largest);
  std::vector<Place> places;
  places.reserve(n);
  for (const auto& part : parts)
    for (const auto& row : part.rows)
      places.push_back(
          {std::uint64_t(std::uint32_t(row.pair[0])) << bits | std::uint32_t(row.pair[1]), &row});
  sort(places);
  return places;
}

// Writes points, normals and weights of the collisions to the final arrays.
template <bool vf>
void describe_all(const Ends& x, const std::vector<Place>& places, int threads, Collisions& out) {
  constexpr std::size_t grain = 2048;
  const ImpactArrays impacts{out.toi.data(), out.point.data(), out.normal.data(),
                             out.weights.data()};
  geometry::interruptible_for(places.size(), threads, grain, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) {
      // Rows and their vertices are scattered in memory, so both are prefetched.
      const auto next = [&](int steps) { return places[std::min(i + steps * ahead, end - 1)].row; };
      __builtin_prefetch(next(2));
      prefetch<true>(x, next(1)->vertices);
      const Row& row = *places[i].row;
      std::copy_n(row.pair, 2, &out.pairs[2 * i]);
      out.toi[i] = row.toi;
      describe<vf>(x, row.vertices, row.toi, impacts, i);
    }
  });
}

Collisions described(const MeshCcd& ccd, MeshCcd::Kind kind, const std::vector<Part>& parts) {
  Collisions all;
  for (const auto& part : parts) {
    all.stats += part.stats;
    all.narrow_s += part.narrow_s;
  }
  const auto places = in_order(parts);
  const std::size_t n = places.size();
  all.pairs = {ccd.spare(), 2 * n};
  all.toi = {ccd.spare(), n};
  all.point = {ccd.spare(), 3 * n};
  all.normal = {ccd.spare(), 3 * n};
  all.weights = {ccd.spare(), 4 * n};
  (kind == MeshCcd::Kind::vf ? describe_all<true> : describe_all<false>)(ccd.ends(), places,
                                                                         ccd.threads(), all);
  return all;
}

}  // namespace

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, Method method, double min_distance,
                           std::size_t limit) {
  const auto solve = kind == MeshCcd::Kind::vf ? solve_vf : solve_ee;
  // Moving volumes have compared x, y and z already.
  const AxisFilter axes{!ccd.volume().moving};
  return find_collisions(
      ccd, kind,
      [=](const Ends& x, const std::int32_t* rows, std::size_t n, std::uint8_t* hit,
          ImpactArrays impacts,
          Stats& stats) { solve(x, rows, n, method, min_distance, hit, impacts, stats, axes); },
      limit);
}

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, const NarrowPhase& narrow_phase,
                           std::size_t limit) {
  std::vector<Part> parts(ccd.chunks(kind));
  std::atomic<std::size_t> found{0};
  const auto start = std::chrono::steady_clock::now();
  ccd.for_each_block(kind, [&](const CandidateBlock& block, std::size_t chunk) {
    const geometry::RoundToNearest guard;  // of this thread
    geometry::Scratch<Answers> scratch;
    Answers& answers = *scratch;
    Part& part = parts[chunk];
    const auto begin = std::chrono::steady_clock::now();
    narrow_phase(ccd.ends(), block.rows.data(), block.size, answers.hit,
                 {answers.toi, nullptr, nullptr, nullptr}, part.stats);
    const std::size_t hits = std::count(answers.hit, answers.hit + block.size, 1);
    if ((found += hits) > limit) throw TooMany("collisions of a kind", limit);
    for (std::size_t i = 0; i < block.size; ++i) {
      if (!answers.hit[i]) continue;
      Row& row = part.rows.emplace_back();
      std::copy_n(&block.pairs[2 * i], 2, row.pair);
      std::copy_n(&block.rows[4 * i], 4, row.vertices);
      row.toi = answers.toi[i];
    }
    part.narrow_s += seconds(begin, std::chrono::steady_clock::now());
  });
  Collisions all = described(ccd, kind, parts);
  all.total_s = seconds(start, std::chrono::steady_clock::now());
  return all;
}

}  // namespace tauguard::cloth
