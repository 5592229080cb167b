#include "frame.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <numeric>
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

// A collision before its point and normal are computed: its pair as one number, and its time.
struct Hit {
  std::uint64_t pair;
  double toi;
  std::int32_t first() const { return static_cast<std::int32_t>(pair >> 32); }
  std::int32_t second() const { return static_cast<std::int32_t>(pair); }
};
// The collisions of one chunk of candidates.
struct Part {
  std::vector<Hit> hits;
  Stats stats;
  double narrow_s = 0;
};

// Output of the narrow phase for a block of candidates.
struct Answers {
  std::uint8_t hit[CandidateBlock::capacity];
  double toi[CandidateBlock::capacity];
  Hit hits[CandidateBlock::capacity];
};

// All collisions in the order of their pairs. A pair occurs once, so the order is unique.
// `features` is the number of values of a pair's first number. Hits are put into groups of
// successive first numbers, at most two groups per hit, and the groups are sorted in parallel.
SpareArray<Hit> in_order(const std::vector<Part>& parts, std::size_t features, int threads,
                         const std::shared_ptr<SpareMemory>& spare) {
  constexpr std::size_t grain = 4096;
  std::size_t n = 0;
  for (const auto& part : parts) n += part.hits.size();
  int shift = 0;
  while (features >> shift > 2 * n) ++shift;
  const std::size_t groups = (features >> shift) + 1;
  SpareArray<Hit> hits(spare, n);
  // The start of each group, and after the hits were moved its end.
  SpareArray<std::size_t> place(spare, groups + 1);
  std::fill_n(place.data(), groups + 1, 0);
  for (const auto& part : parts)
    for (const auto& hit : part.hits) ++place[(hit.first() >> shift) + 1];
  std::partial_sum(place.data(), place.data() + groups, place.data());
  for (const auto& part : parts)
    for (const auto& hit : part.hits) hits[place[hit.first() >> shift]++] = hit;
  geometry::interruptible_for(groups, threads, grain, [&](auto begin, auto end, auto) {
    for (auto group = begin; group < end; ++group)
      std::sort(hits.data() + (group == 0 ? 0 : place[group - 1]), hits.data() + place[group],
                [](const Hit& a, const Hit& b) { return a.pair < b.pair; });
  });
  return hits;
}

// Writes pairs, times, points, normals and weights to the final arrays. The first number of a pair
// refers to `a` and the second to `b`; in a vertex-face pair the first number is the vertex itself.
template <bool vf>
void describe_all(const Ends& x, const Features& a, const Features& b, const SpareArray<Hit>& hits,
                  double distance, int threads, Collisions& out) {
  constexpr std::size_t grain = 2048;
  const ImpactArrays impacts{out.toi.data(), out.point.data(), out.normal.data(),
                             out.weights.data()};
  const auto fill = [&](const Hit& hit, std::int32_t* row) {
    vf ? void(row[0] = hit.first()) : void(std::copy_n(a.of(hit.first()), 2, row));
    std::copy_n(b.of(hit.second()), vf ? 3 : 2, row + (vf ? 1 : 2));
  };
  geometry::interruptible_for(hits.size(), threads, grain, [&](auto begin, auto end, auto) {
    for (auto i = begin; i < end; ++i) {
      // Features and their vertices are scattered in memory, so both are prefetched.
      const auto next = [&](int steps) -> const Hit& {
        return hits[std::min(i + steps * ahead, end - 1)];
      };
      std::int32_t row[4];
      __builtin_prefetch(b.of(next(2).second()));
      fill(next(1), row);
      prefetch<true>(x, row);
      const Hit& hit = hits[i];
      fill(hit, row);
      out.pairs[2 * i] = hit.first();
      out.pairs[2 * i + 1] = hit.second();
      out.toi[i] = hit.toi;
      describe<vf>(x, row, hit.toi, distance, impacts, i);
    }
  });
}

Collisions described(const MeshCcd& ccd, MeshCcd::Kind kind, double distance,
                     const std::vector<Part>& parts) {
  Collisions all;
  for (const auto& part : parts) {
    all.stats += part.stats;
    all.narrow_s += part.narrow_s;
  }
  const bool vf = kind == MeshCcd::Kind::vf;
  const Topology& of = ccd.topology();
  const Features &a = vf ? of.vertices : of.edges, &b = vf ? of.faces : of.edges;
  const auto hits = in_order(parts, vf ? of.rows() : a.size(), ccd.threads(), ccd.spare());
  const std::size_t n = hits.size();
  all.pairs = {ccd.spare(), 2 * n};
  all.toi = {ccd.spare(), n};
  all.point = {ccd.spare(), 3 * n};
  all.normal = {ccd.spare(), 3 * n};
  all.weights = {ccd.spare(), 4 * n};
  (vf ? describe_all<true> : describe_all<false>)(ccd.ends(), a, b, hits, distance, ccd.threads(),
                                                  all);
  return all;
}

}  // namespace

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, Method method, double min_distance,
                           std::size_t limit) {
  const auto solve = kind == MeshCcd::Kind::vf ? solve_vf : solve_ee;
  // With moving volumes, the broad phase has compared x, y and z already.
  const AxisFilter axes{!ccd.volume().moving};
  return find_collisions(
      ccd, kind,
      [=](const Ends& x, const std::int32_t* rows, std::size_t n, std::uint8_t* hit,
          ImpactArrays impacts,
          Stats& stats) { solve(x, rows, n, method, min_distance, hit, impacts, stats, axes); },
      limit, min_distance);
}

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, const NarrowPhase& narrow_phase,
                           std::size_t limit, double min_distance) {
  std::vector<Part> parts(ccd.chunks(kind));
  std::atomic<std::size_t> found{0};
  const auto start = std::chrono::steady_clock::now();
  ccd.for_each_block(kind, [&](const CandidateBlock& block, std::size_t chunk) {
    const geometry::RoundToNearest guard;  // rounding mode of this thread
    geometry::Scratch<Answers> scratch;
    Answers& answers = *scratch;
    Part& part = parts[chunk];
    const auto begin = std::chrono::steady_clock::now();
    narrow_phase(ccd.ends(), block.rows.data(), block.size, answers.hit,
                 {answers.toi, nullptr, nullptr, nullptr}, part.stats);
    std::size_t hits = 0;
    for (std::size_t i = 0; i < block.size; ++i) {  // no branch, which would be mispredicted
      const std::int32_t* pair = &block.pairs[2 * i];
      const std::uint64_t first = std::uint32_t(pair[0]), second = std::uint32_t(pair[1]);
      answers.hits[hits] = {first << 32 | second, answers.toi[i]};
      hits += answers.hit[i];
    }
    if ((found += hits) > limit) throw TooMany("collisions of a kind", limit);
    part.hits.insert(part.hits.end(), answers.hits, answers.hits + hits);
    part.narrow_s += seconds(begin, std::chrono::steady_clock::now());
  });
  Collisions all = described(ccd, kind, min_distance, parts);
  all.total_s = seconds(start, std::chrono::steady_clock::now());
  return all;
}

}  // namespace tauguard::cloth
