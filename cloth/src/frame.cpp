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

// All collisions in the order of their pairs. A pair occurs once, so the order is unique. It is a
// radix sort from the last digit, which skips bits that no pair uses.
SpareArray<Hit> in_order(const std::vector<Part>& parts,
                         const std::shared_ptr<SpareMemory>& spare) {
  constexpr int digit = 11;
  std::size_t n = 0;
  for (const auto& part : parts) n += part.hits.size();
  SpareArray<Hit> hits(spare, n), other(spare, n);
  std::uint64_t used = 0;
  Hit* next = hits.data();
  for (const auto& part : parts) {
    for (const auto& hit : part.hits) used |= hit.pair;
    next = std::copy(part.hits.begin(), part.hits.end(), next);
  }
  for (int shift = 0; shift < 64 && used >> shift != 0; shift += digit) {
    shift += __builtin_ctzll(used >> shift);
    const auto value = [shift](const Hit& hit) { return hit.pair >> shift & ((1u << digit) - 1); };
    const Hit *begin = hits.data(), *end = begin + n;
    std::size_t start[(1 << digit) + 1] = {};
    for (const Hit* hit = begin; hit < end; ++hit) ++start[value(*hit) + 1];
    for (int i = 0; i < 1 << digit; ++i) start[i + 1] += start[i];
    for (const Hit* hit = begin; hit < end; ++hit) other[start[value(*hit)]++] = *hit;
    std::swap(hits, other);
  }
  return hits;
}

// Writes pairs, times, points, normals and weights to the final arrays. The first number of a pair
// refers to `a` and the second to `b`; in a vertex-face pair the first number is the vertex itself.
template <bool vf>
void describe_all(const Ends& x, const Features& a, const Features& b, const SpareArray<Hit>& hits,
                  int threads, Collisions& out) {
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
      describe<vf>(x, row, hit.toi, impacts, i);
    }
  });
}

Collisions described(const MeshCcd& ccd, MeshCcd::Kind kind, const std::vector<Part>& parts) {
  Collisions all;
  for (const auto& part : parts) {
    all.stats += part.stats;
    all.narrow_s += part.narrow_s;
  }
  const auto hits = in_order(parts, ccd.spare());
  const std::size_t n = hits.size();
  all.pairs = {ccd.spare(), 2 * n};
  all.toi = {ccd.spare(), n};
  all.point = {ccd.spare(), 3 * n};
  all.normal = {ccd.spare(), 3 * n};
  all.weights = {ccd.spare(), 4 * n};
  const bool vf = kind == MeshCcd::Kind::vf;
  const Topology& of = ccd.topology();
  const Features &a = vf ? of.vertices : of.edges, &b = vf ? of.faces : of.edges;
  (vf ? describe_all<true> : describe_all<false>)(ccd.ends(), a, b, hits, ccd.threads(), all);
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
      limit);
}

Collisions find_collisions(MeshCcd& ccd, MeshCcd::Kind kind, const NarrowPhase& narrow_phase,
                           std::size_t limit) {
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
  Collisions all = described(ccd, kind, parts);
  all.total_s = seconds(start, std::chrono::steady_clock::now());
  return all;
}

}  // namespace tauguard::cloth
