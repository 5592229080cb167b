// Random arms with everything that judges their samples: chains, friction models, estimators, and a
// monitor of each kind of native stream.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "estimator.hpp"
#include "free_motion.hpp"
#include "hard_numbers.hpp"
#include "monitor.hpp"

namespace random_arm {

using namespace tauguard::detectors;
using Numbers = std::vector<double>;

inline double uniform(Random& random, double low, double high) {
  return low + (high - low) * double(random() % 100001) / 100000;
}

inline Numbers uniforms(Random& random, std::size_t n, double low, double high) {
  Numbers out(n);
  for (double& x : out) x = uniform(random, low, high);
  return out;
}

// A tree of joints, some prismatic, some on the base.
inline Chain chain_of(Random& random, std::size_t n) {
  Chain chain;
  chain.gravity = {0, 0, -9.81};
  for (std::size_t j = 0; j < n; ++j) {
    Joint joint;
    joint.parent = random() % 5 ? static_cast<int>(j) - 1 : -1;
    joint.prismatic = random() % 4 == 0;
    joint.axis = {0, 0, 1};
    joint.offset = {0.3, 0, 0.1};
    const double fixed[9] = {0, 0, 0, 0, 0, 0, 0, 0, 1}, cosine[9] = {1, 0, 0, 0, 1, 0, 0, 0, 0},
                 sine[9] = {0, -1, 0, 1, 0, 0, 0, 0, 0}, whole[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    std::copy_n(joint.prismatic ? whole : fixed, 9, joint.fixed.m);
    if (!joint.prismatic)
      std::copy_n(cosine, 9, joint.cosine.m), std::copy_n(sine, 9, joint.sine.m);
    joint.slide = {0, 0, 1};
    joint.inertial.mass = uniform(random, 0, 5);
    joint.inertial.moment = {0.1, 0.2, 0.1};
    joint.inertial.xx = joint.inertial.yy = joint.inertial.zz = 0.1;
    joint.armature = uniform(random, 0, 1);
    chain.joints.push_back(joint);
  }
  return chain;
}

inline FrictionBasis basis_of(Random& random, std::size_t joints) {
  FrictionBasis basis;
  basis.bristles = uniforms(random, random() % 3, 1e-4, 1e-2);
  basis.stops =
      uniforms(random, basis.bristles.empty() ? 1 + random() % 2 : random() % 3, 1e-4, 1e-2);
  basis.stribeck = uniforms(random, random() % 3, 0.01, 0.5);
  basis.slopes = uniforms(random, random() % 3, 0.01, 0.5);
  basis.loaded = uniforms(random, random() % 2, 0.01, 0.5);
  basis.saturation = random() % 2, basis.modelled = random() % 2;
  basis.ripples = random() % 3;
  basis.cycles = uniforms(random, joints * basis.ripples, 1, 200);
  basis.play = random() % 2 ? 1e-4 : 0;
  return basis;
}

inline EstimatorSettings settings_of(Random& random, std::size_t n, std::size_t columns,
                                     bool adapts) {
  EstimatorSettings s;
  const std::size_t unknowns = payload_numbers + per_joint * n;
  s.drive_gain = uniforms(random, n, 1, 20), s.gain = uniforms(random, n, 10, 200);
  s.weights = uniforms(random, n * columns, 0, 1);
  s.deviation = adapts ? uniforms(random, unknowns, 0, 1) : Numbers(unknowns, 0.0);
  s.persistence = uniforms(random, unknowns, 1, 60), s.noise = uniforms(random, n, 0.1, 1);
  s.every = uniform(random, 1e-3, 2e-2), s.started = random() % 2 ? 0.1 : 0,
  s.weighted = random() % 2;
  s.inflation = random() % 2 ? 20 : 1, s.transition = random() % 2 ? 0.1 : 0;
  if (adapts && random() % 2) s.fusion = uniforms(random, n * VelocityFusion::gain_numbers, 0, 0.5);
  return s;
}

inline FreeMotion free_motion_of(Random& random, const Chain& chain, const FrictionBasis& basis) {
  const std::size_t n = chain.joints.size();
  Estimator estimator(chain, basis, settings_of(random, n, basis.columns(), true));
  return {std::move(estimator),
          {uniforms(random, n, 0.1, 1), uniforms(random, n, 0, 1), uniforms(random, n, 0.1, 1),
           uniforms(random, RegimeBounds::terms * n, 0, 1), uniforms(random, n, 0, 1),
           uniforms(random, n, 0, 1), uniforms(random, n, 0.1, 2), uniforms(random, n, 1, 20),
           uniforms(random, n, 0, 1), Numbers(n, -1e6), uniforms(random, n, 1, 2e6)}};
}

// The three kinds of streams that are native, of one arm.
inline std::shared_ptr<Scores> scores_of(Random& random, int kind, const Chain& chain,
                                         const FrictionBasis& basis) {
  const std::size_t n = chain.joints.size();
  if (kind == 0) return std::make_shared<FreeScores>(free_motion_of(random, chain, basis));
  std::vector<std::int64_t> joints;
  for (std::size_t j = 0; j < n; ++j) joints.push_back(static_cast<std::int64_t>(n - 1 - j));
  const Numbers weights = random() % 2 ? Numbers{} : uniforms(random, noise_terms * n, 0.1, 1);
  Estimator estimator(chain, basis, settings_of(random, n, basis.columns(), true));
  ScaledResidual residual(std::move(estimator), Scaling(joints, weights, 1, 0.5, random() % 2));
  if (kind == 1)
    return std::make_shared<LimitScores>(std::move(residual), uniforms(random, n, 0.1, 2));
  const std::size_t count = 1 + random() % 11, size = n * count, vectors = random() % 40;
  const Numbers z = uniforms(random, vectors * size, -1, 1), c = uniforms(random, vectors, -1, 1);
  return std::make_shared<KernelScores>(
      std::move(residual), Window(n, 1 + random() % 8, count),
      KernelSum(z.data(), c.data(), vectors, size, 0.1, 3), random() % 2,
      Floor{Scaling(joints, weights, 1, 1, false), uniforms(random, n, 0.1, 2)});
}

struct MonitoredArm {
  MonitoredArm(std::uint64_t seed, int kind)
      : random(seed), n(1 + random() % 7), chain(chain_of(random, n)) {
    const FrictionBasis basis = basis_of(random, n);
    const Numbers one(n, 1.0);
    Usual usual{dt,
                0.01,
                8,
                20.0,
                6,
                10,
                Numbers(n, 10.0),
                0.2,
                0.5,
                one,
                one,
                std::vector<std::int64_t>(n, 9)};
    Levels levels{{0.5, 1.0, 1.0, 4.0}, {0, 0.1, 0.2, 0.3}, {1, 1, 2, 2}};
    if (random() % 2) levels = {};
    TorqueBounds bounds;
    bounds.opposed = Numbers(n, -0.4), bounds.least = Numbers(n, 0.4);
    bounds.most = Numbers(n, 1.7);
    // Only the score of a kernel has plain thresholds beneath it.
    const Levels floor = kind == 2 ? levels : Levels{};
    Alarm alarm(scores_of(random, kind, chain, basis), {dt, 0.1, 0.5, 2, 250, levels, floor});
    Estimator observer(chain, basis, settings_of(random, n, basis.columns(), false));
    monitor.reset(new Monitor(FaultCheck(usual), std::move(alarm), std::move(observer),
                              TorqueCheck(one, one, bounds), {dt, 0.1, 0.02, 0.1, 2}));
  }
  static constexpr double dt = 2e-3;
  Random random;
  std::size_t n;
  Chain chain;
  std::unique_ptr<Monitor> monitor;
};

}  // namespace random_arm
