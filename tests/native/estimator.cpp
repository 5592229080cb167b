// The estimator and the free-motion detector without an interpreter, for the sanitizers: random
// arms and friction models, samples of every size that Python lets pass. Prints what it tried.
#include "estimator.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "free_motion.hpp"
#include "hard_numbers.hpp"

namespace {

using namespace tauguard::detectors;
using Numbers = std::vector<double>;

double uniform(Random& random, double low, double high) {
  return low + (high - low) * double(random() % 100001) / 100000;
}

Numbers uniforms(Random& random, std::size_t n, double low, double high) {
  Numbers out(n);
  for (double& x : out) x = uniform(random, low, high);
  return out;
}

// A tree of joints, some prismatic, some on the base.
Chain chain_of(Random& random, std::size_t n) {
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

FrictionBasis basis_of(Random& random, std::size_t joints) {
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

EstimatorSettings settings_of(Random& random, std::size_t n, std::size_t columns, bool adapts) {
  EstimatorSettings s;
  const std::size_t unknowns = payload_numbers + per_joint * n;
  s.drive_gain = uniforms(random, n, 1, 20), s.gain = uniforms(random, n, 10, 200);
  s.weights = uniforms(random, n * columns, 0, 1);
  s.deviation = adapts ? uniforms(random, unknowns, 0, 1) : Numbers(unknowns, 0.0);
  s.persistence = uniforms(random, unknowns, 1, 60), s.noise = uniforms(random, n, 0.1, 1);
  s.every = 1 + static_cast<int>(random() % 10), s.payload_weight = random() % 2 ? 20 : 0;
  if (adapts && random() % 2) s.fusion = uniforms(random, n * VelocityFusion::gain_numbers, 0, 0.5);
  return s;
}

// Samples of a motion; in the hard kind finite numbers of every size come in between.
struct Motion {
  Motion(Random& random, std::size_t n, std::size_t samples, bool hard) : dt(samples) {
    for (std::size_t k = 0; k < samples; ++k) {
      dt[k] = hard && random() % 50 == 0 ? std::fabs(hard_number(random)) + 1e-9
                                         : uniform(random, 1e-3, 3e-3);
      for (std::size_t j = 0; j < n; ++j) {
        const double phase = 2e-3 * double(k) + double(j);
        q.push_back(std::sin(phase)), qd.push_back(std::cos(phase) * (k % 400 < 300));
        current.push_back(uniform(random, -3, 3));
      }
      if (!hard || random() % 20) continue;
      const double sizes[] = {1e300, -1e300, 5e-324, 1e30, 0.0, 1e150, -1e8};
      Numbers* parts[] = {&q, &qd, &current};
      parts[random() % 3]->end()[-1 - int(random() % n)] = sizes[random() % 7];
    }
  }
  Numbers dt, q, qd, current;
};

bool close(double a, double b) { return std::fabs(a - b) <= 1e-9 * (1 + std::fabs(a)); }

// Without unknowns it is the plain observer on torques less friction; after a reset it says the
// same again.
int estimators(Random& random, int rounds) {
  constexpr std::size_t samples = 300;
  for (int round = 0; round < 10 * rounds; ++round) {
    const std::size_t n = 1 + random() % 7;
    const bool adapts = round % 3 != 0, hard = round % 2;
    const Chain chain = chain_of(random, n);
    const FrictionBasis basis = basis_of(random, n);
    const EstimatorSettings set = settings_of(random, n, basis.columns(), adapts);
    Estimator estimator(chain, basis, set);
    Observer observer(chain, set.gain);
    const Motion m(random, n, samples, hard);
    Numbers residual(n), unexplained(n), acceleration(n), first, tau(n), column(basis.columns());
    Numbers memory(n * basis.memory()), p(n), beta(n);
    Workspace work(n);
    for (int turn = 0; turn < 2; ++turn) {
      Numbers all;
      estimator.reset();
      for (std::size_t k = 0; k < samples; ++k) {
        const double *q = &m.q[k * n], *qd = &m.qd[k * n], *current = &m.current[k * n];
        estimator.step(q, qd, current, m.dt[k], residual.data(), unexplained.data(),
                       acceleration.data());
        all.insert(all.end(), unexplained.begin(), unexplained.end());
        if (turn || adapts || hard) continue;
        chain.momentum(q, qd, p.data(), beta.data(), work);
        for (std::size_t j = 0; j < n; ++j) {
          double* own = &memory[j * basis.memory()];
          if (k == 0) basis.reset(q[j], own);
          const double torque = set.drive_gain[j] * current[j];
          basis.evaluate(j, q[j], qd[j], torque, basis.modelled ? beta[j] : torque, own,
                         column.data());
          tau[j] = torque;
          for (std::size_t c = 0; c < column.size(); ++c)
            tau[j] -= set.weights[j * column.size() + c] * column[c];
        }
        if (k == 0)
          observer.reset(q, qd, tau.data());
        else
          observer.step(q, qd, tau.data(), m.dt[k]);
        for (std::size_t j = 0; j < n; ++j)
          check(close(observer.residual()[j], unexplained[j]), "not the plain observer's residual");
      }
      if (turn == 0) first = all;
      check(turn == 0 || !std::memcmp(all.data(), first.data(), 8 * all.size()),
            "after a reset it says something else");
      for (const double x : all) check(hard || std::isfinite(x), "a residual that is no number");
    }
  }
  return 10 * rounds * 600;
}

int free_motions(Random& random, int rounds) {
  constexpr std::size_t samples = 500;
  for (int round = 0; round < 10 * rounds; ++round) {
    const std::size_t n = 1 + random() % 7;
    const FrictionBasis basis = basis_of(random, n);
    FreeSettings set{
        uniforms(random, n, 1, 20),
        uniforms(random, n * basis.columns(), 0, 1),
        uniforms(random, n, 0.1, 5),
        uniform(random, 0, 2),
        uniform(random, 0, 0.2),
        {uniforms(random, n, 0.1, 1), uniforms(random, n, 0, 1), uniforms(random, n, 0.1, 1),
         uniforms(random, 4 * n, 0, 1), uniforms(random, n, 0, 1)}};
    FreeMotion stream(chain_of(random, n), basis, set);
    const bool hard = round % 2;
    const Motion m(random, n, samples, hard);
    Numbers first;
    for (int turn = 0; turn < 2; ++turn) {
      Numbers all;
      stream.reset();
      for (std::size_t k = 0; k < samples; ++k) {
        stream.step(&m.q[k * n], &m.qd[k * n], &m.current[k * n], m.dt[k]);
        all.insert(all.end(), stream.ratio().begin(), stream.ratio().end());
        for (std::size_t j = 0; j < n; ++j) stream.rest(j);
      }
      if (turn == 0) first = all;
      check(turn == 0 || !std::memcmp(all.data(), first.data(), 8 * all.size()),
            "after a reset it says something else");
      for (const double x : all) check(hard || x >= 0, "a ratio that is none");
    }
  }
  return 10 * rounds * 1000;
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  Random random(5);
  const int estimated = estimators(random, effort), judged = free_motions(random, effort);
  std::printf("estimator samples %d, free-motion samples %d: %d wrong\n", estimated, judged,
              failures);
  return failures != 0;
}
