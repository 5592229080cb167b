#include "frame.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>

#include "tauguard/geometry/rounding.hpp"
#include "tauguard/geometry/scratch.hpp"
#include "too_many.hpp"

namespace tauguard::cloth {
namespace {

using Instant = std::chrono::steady_clock::time_point;

double seconds(Instant from, Instant to) {
  return std::chrono::duration<double>(to - from).count();
}

// One collision, and those of one chunk of candidates.
struct Row {
  std::int32_t pair[2];
  double toi, point[3], normal[3], weights[4];
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

// By key, a digit at a time from the last (radix sort); digits that are zero in all keys are passed
// over.
void sort(std::vector<Place>& places) {
  constexpr int digit = 11;
  std::vector<Place> other(places.size());
  std::uint64_t used = 0;
  for (const auto& at : places) used |= at.key;
  for (int shift = 0; shift < 64; shift += digit) {
    const auto value = [shift](std::uint64_t key) { return key >> shift & ((1u << digit) - 1); };
    if (value(used) == 0) continue;
    std::size_t start[(1 << digit) + 1] = {};
    for (const auto& at : places) ++start[value(at.key) + 1];
    for (int i = 0; i < 1 << digit; ++i) start[i + 1] += start[i];
    for (const auto& at : places) other[start[value(at.key)]++] = at;
    places.swap(other);
  }
}

// What the narrow phase writes for a block of candidates.
struct Answers {
  static constexpr std::size_t n = CandidateBlock::capacity;
  std::vector<std::uint8_t> hit = std::vector<std::uint8_t>(n);
  std::vector<double> toi = std::vector<double>(n), point = std::vector<double>(3 * n),
                      normal = std::vector<double>(3 * n), weights = std::vector<double>(4 * n);
};

// One list in the order of the pairs. A pair occurs once, so that the order is unique.
Collisions sorted(const std::vector<Part>& parts) {
  Collisions all;
  std::vector<Place> places;
  for (const auto& part : parts) {
    for (const auto& row : part.rows)
      places.push_back(
          {std::uint64_t(std::uint32_t(row.pair[0])) << 32 | std::uint32_t(row.pair[1]), &row});
    all.stats += part.stats;
    all.narrow_s += part.narrow_s;
  }
  sort(places);
  const std::size_t n = places.size();
  all.pairs.resize(2 * n);
  all.toi.resize(n);
  all.point.resize(3 * n);
  all.normal.resize(3 * n);
  all.weights.resize(4 * n);
  for (std::size_t i = 0; i < n; ++i) {
    const Row& row = *places[i].row;
    std::copy_n(row.pair, 2, &all.pairs[2 * i]);
    all.toi[i] = row.toi;
    std::copy_n(row.point, 3, &all.point[3 * i]);
    std::copy_n(row.normal, 3, &all.normal[3 * i]);
    std::copy_n(row.weights, 4, &all.weights[4 * i]);
  }
  return all;
}

}  // namespace

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, Method method, double min_distance,
                           std::size_t limit) {
  const auto solve = kind == MeshCcd::Kind::vf ? solve_vf : solve_ee;
  // Volumes that move have compared x, y and z already.
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
    const std::size_t before = part.rows.size();
    const auto begin = std::chrono::steady_clock::now();
    narrow_phase(
        ccd.ends(), block.rows.data(), block.size, answers.hit.data(),
        {answers.toi.data(), answers.point.data(), answers.normal.data(), answers.weights.data()},
        part.stats);
    for (std::size_t i = 0; i < block.size; ++i) {
      if (!answers.hit[i]) continue;
      Row& row = part.rows.emplace_back();
      std::copy_n(&block.pairs[2 * i], 2, row.pair);
      row.toi = answers.toi[i];
      std::copy_n(&answers.point[3 * i], 3, row.point);
      std::copy_n(&answers.normal[3 * i], 3, row.normal);
      std::copy_n(&answers.weights[4 * i], 4, row.weights);
    }
    if ((found += part.rows.size() - before) > limit) throw TooMany("collisions of a kind", limit);
    part.narrow_s += seconds(begin, std::chrono::steady_clock::now());
  });
  Collisions all = sorted(parts);
  all.total_s = seconds(start, std::chrono::steady_clock::now());
  return all;
}

}  // namespace tauguard::cloth
