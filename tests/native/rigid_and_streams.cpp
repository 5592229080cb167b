// Convex bodies, meshes and the detectors' streams without an interpreter, for the sanitizers:
// degenerate and huge shapes by three methods and several threads, and samples that are no numbers.
// Prints what it tried.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>
#include <thread>

#include "convex_overlap.hpp"
#include "faults.hpp"
#include "hard_numbers.hpp"
#include "mesh_query.hpp"
#include "observer.hpp"
#include "tauguard/geometry/rounding.hpp"
#include "torques.hpp"

namespace {

using namespace tauguard::rigid;
namespace detectors = tauguard::detectors;

std::vector<double> numbers(Random& random, std::size_t n) {
  std::vector<double> x(n);
  for (auto& v : x) v = hard_number(random);
  return x;
}

// Tetrahedra and hulls, many of them flat or a point: all methods and threads give one answer.
void convex(Random& random, int rounds) {
  constexpr std::size_t n = 200;
  for (int round = 0; round < rounds; ++round) {
    const auto a = numbers(random, 12 * n), cloud = numbers(random, 3 * 7 * n);
    std::vector<std::int64_t> offsets(n + 1);
    for (std::size_t i = 0; i < n; ++i)
      offsets[i + 1] = offsets[i] + 1 + static_cast<std::int64_t>(random() % 7);
    const Bodies tetrahedra{Kind::tetrahedra, a.data(), nullptr, n};
    const Bodies hulls{Kind::hulls, cloud.data(), offsets.data(), n};
    for (const Bodies* other : {&tetrahedra, &hulls}) {
      std::vector<std::uint8_t> exact(n), hit(n);
      overlap(tetrahedra, *other, n, Method::exact, 1, exact.data());
      overlap(tetrahedra, *other, n, Method::automatic, 1 + round % 3, hit.data());
      check(hit == exact, "a convex overlap differs from exact");
    }
  }
}

// Two random meshes: every volume, and every thread on its own scratch, finds what boxes find.
void meshes(Random& random, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    const std::int32_t vertices = 60, faces = 1 + static_cast<std::int32_t>(random() % 90);
    std::vector<double> x(3 * vertices);
    for (auto& v : x) v = double(random() % 1000) / 1000;
    std::vector<std::int32_t> rows(3 * faces);
    for (auto& v : rows) v = static_cast<std::int32_t>(random() % vertices);
    double m[16] = {1, 0, 0, double(random() % 100) / 80, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    const Pose pose(m);
    std::vector<bool> found;
    for (const auto kind :
         {VolumeKind::aabb, VolumeKind::obb, VolumeKind::k_dop, VolumeKind::sphere}) {
      const Mesh mesh(x.data(), rows.data(), static_cast<std::size_t>(faces), kind);
      std::vector<char> answers(3);
      std::vector<std::thread> askers;
      for (auto& answer : answers)
        askers.emplace_back([&] {
          Scratch scratch;
          answer = first_overlap(mesh, mesh, pose, scratch).a >= 0;
        });
      for (auto& asker : askers) asker.join();
      for (const char answer : answers) found.push_back(answer != 0);
    }
    check(found == std::vector<bool>(found.size(), found[0]), "volumes differ");
  }
}

// Samples of any kind: what is no number is named, and never gets into what is remembered.
void streams(Random& random, int rounds) {
  constexpr std::size_t n = 6;
  const std::vector<double> one(n, 1.0);
  detectors::Usual usual{2e-3, 8e-3, 8, 20.0, 6, 10, one, 0.2, 0.5, one, one, {9, 9, 9, 9, 9, 9}};
  detectors::FaultCheck check_samples(usual);
  detectors::TorqueBounds bounds;
  bounds.opposed = std::vector<double>(n, -0.4);
  bounds.least = std::vector<double>(n, 0.4);
  bounds.most = std::vector<double>(n, 1.7);
  detectors::TorqueCheck torques(one, one, bounds);
  detectors::Chain chain;
  for (std::size_t j = 0; j < n; ++j) {
    detectors::Joint joint;
    joint.parent = static_cast<int>(j) - 1;
    joint.axis = {0, 0, 1};
    joint.offset = {0.3, 0, 0.1};
    joint.inertial.mass = 1;
    joint.armature = 0.1;
    chain.joints.push_back(joint);
  }
  chain.gravity = {0, 0, -9.81};
  detectors::Observer observer(chain, std::vector<double>(n, 50.0));
  double t = 0;
  for (int k = 0; k < 2000 * rounds; ++k) {
    t += random() % 50 ? 2e-3 : hard_number(random);
    std::vector<double> q(n), qd(n), current(n);
    for (std::size_t j = 0; j < n; ++j) {
      q[j] = std::sin(1e-3 * k + double(j));
      qd[j] = 0.5 * std::cos(1e-3 * k + double(j));
      current[j] = 0.1 * double(random() % 9);
    }
    bool bad = false;
    if (random() % 20 == 0) {
      const double strange[] = {std::nan(""), std::numeric_limits<double>::infinity(), 1e308};
      std::vector<double>* parts[] = {&qd, &current};
      (*parts[random() % 2])[random() % n] = strange[random() % 3];
      bad = true;
    }
    const auto verdict = check_samples.step(t, q.data(), qd.data(), current.data());
    check(!bad || verdict.fault != detectors::Fault::none, "a sample that is no number passes");
    if (bad) continue;
    if (!observer.started()) observer.reset(q.data(), qd.data(), current.data());
    const double* residual = observer.step(q.data(), qd.data(), current.data(), 2e-3);
    for (std::size_t j = 0; j < n; ++j) check(std::isfinite(residual[j]), "a residual is NaN");
    torques.step(residual, current.data(), 2e-3);
  }
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  const tauguard::geometry::RoundToNearest guard;
  Random random(2);
  convex(random, effort);
  meshes(random, 5 * effort);
  streams(random, effort);
  std::printf("convex queries %d, meshes %d, samples %d: %d wrong\n", 2 * 200 * effort, 5 * effort,
              2000 * effort, failures);
  return failures != 0;
}
