// The native core without an interpreter, for the sanitizers: random meshes asked from several
// threads, changed, interrupted and bounded; single queries of the hard kinds. Prints what it
// tried.
#include <cmath>
#include <cstdio>
#include <mutex>
#include <random>
#include <thread>

#include "frame.hpp"
#include "hard_numbers.hpp"
#include "tauguard/geometry/call_lock.hpp"
#include "tauguard/geometry/signs.hpp"
#include "too_many.hpp"

namespace {

using namespace tauguard::cloth;
using tauguard::geometry::CallLock;
using tauguard::geometry::InterruptScope;
using tauguard::geometry::ThreadPool;

std::vector<double> numbers(Random& random, std::size_t n, bool hard) {
  std::vector<double> x(n);
  for (auto& v : x) v = hard ? hard_number(random) : double(random() % 10000) / 10000;
  return x;
}

// Faces of n vertices; some stand for edges and points, at the end.
std::vector<std::int32_t> faces_of(Random& random, int n, int count) {
  std::vector<std::int32_t> rows;
  for (int i = 0; i < count; ++i) {
    const int a = int(random() % (n - 2));
    rows.insert(rows.end(), {a, a + 1, a + 2});
  }
  for (int i = 0; i < 4; ++i) rows.insert(rows.end(), {n + i, n + i + 1, n + i + 1});
  for (int i = 5; i < 9; ++i) rows.insert(rows.end(), {n + i, n + i, n + i});
  return rows;
}

void queries(Random& random, int rounds) {
  constexpr int n = 256;
  std::vector<std::int32_t> rows(4 * n);
  for (int i = 0; i < 4 * n; ++i) rows[i] = i;
  std::vector<std::uint8_t> hit(n), again(n);
  std::vector<double> toi(n), point(3 * n), normal(3 * n), weights(4 * n);
  for (int round = 0; round < rounds; ++round) {
    const auto x0 = numbers(random, 12 * n, true), x1 = numbers(random, 12 * n, true);
    const Ends x = Ends::of(x0.data(), x1.data());
    for (int kind = 0; kind < 2; ++kind) {
      const auto solve = kind ? solve_vf : solve_ee;
      Stats stats;
      const ImpactArrays out{toi.data(), point.data(), normal.data(), weights.data()};
      solve(x, rows.data(), n, Method::ab2pf, 0, hit.data(), out, stats, {});
      solve(x, rows.data(), n, Method::exact, 0, again.data(), out, stats, {});
      check(hit == again, "ab2pf differs from exact");
    }
  }
}

void mesh(Random& random, int rounds) {
  constexpr int n = 400;
  auto faces = faces_of(random, n - 9, 500);
  MeshCcd ccd(faces, {}, VolumeKind{14, true}, true, 3),
      one(faces, {}, VolumeKind{14, true}, true, 1);
  CallLock lock;
  const auto ask = [&](Random seed) {
    for (int round = 0; round < rounds; ++round) {
      const auto x0 = numbers(seed, 3 * n, false), x1 = numbers(seed, 3 * n, false);
      const std::lock_guard<CallLock> call(lock);
      if (round % 5 == 3) {
        faces = faces_of(seed, n - 9, 300 + int(seed() % 300));
        ccd.update_topology(faces, {});
        one.update_topology(faces, {});
      }
      try {
        ccd.prepare(x0.data(), x1.data(), n, 0, round % 3 == 0, round % 7 == 2 ? 9 : 1000000);
        const auto ours = find_collisions(ccd, MeshCcd::Kind::ee, Method::ab2pf, 0, 1000000);
        one.prepare(x0.data(), x1.data(), n, 0, false, 1000000);
        const auto theirs = find_collisions(one, MeshCcd::Kind::ee, Method::ab2pf, 0, 1000000);
        check(ours.pairs == theirs.pairs && ours.toi == theirs.toi, "threads change an answer");
      } catch (const TooMany&) { check(round % 7 == 2, "a limit that was not set"); }
    }
  };
  std::thread other(ask, Random(random())), third(ask, Random(random()));
  ask(Random(random()));
  other.join();
  third.join();
}

void interrupted() {
  constexpr int n = 900;
  std::vector<std::int32_t> faces(n);
  for (int i = 0; i < n; ++i) faces[i] = i;
  const std::vector<double> x(3 * n, 0.0);
  MeshCcd ccd(faces, {}, VolumeKind{14, true}, true, 3);
  InterruptScope::ask = [] { return true; };
  bool stopped = false;
  try {
    const InterruptScope scope;
    for (int i = 0; i < 1000; ++i) {
      ccd.prepare(x.data(), x.data(), n, 0, true, 10000000);
      find_collisions(ccd, MeshCcd::Kind::ee, Method::exact, 0, 10000000);
    }
  } catch (const tauguard::geometry::Interrupted&) { stopped = true; }
  InterruptScope::ask = nullptr;
  check(stopped, "an interrupt that was not heard");
}

void pool(int rounds) {
  std::vector<std::thread> callers;
  for (int c = 0; c < 3; ++c)
    callers.emplace_back([rounds] {
      for (int round = 0; round < rounds; ++round) {
        std::vector<int> seen(1000, 0);
        ThreadPool::shared().parallel_for(1000, 1 + round % 4, 7, [&](auto b, auto e, auto) {
          for (auto i = b; i < e; ++i) ++seen[i];
        });
        for (const int s : seen) check(s == 1, "an item not done once");
      }
    });
  for (auto& caller : callers) caller.join();
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  const tauguard::geometry::RoundToNearest guard;
  Random random(1);
  pool(20 * effort);
  mesh(random, effort);
  interrupted();
  queries(random, effort);
  std::printf("pool %d, mesh calls %d, queries %d: %d wrong\n", 60 * effort, 3 * effort,
              2 * 256 * effort, failures);
  return failures != 0;
}
