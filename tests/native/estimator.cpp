// The estimator, the free-motion detector and the monitor without an interpreter, for the
// sanitizers: random arms and friction models, samples of every size that Python lets pass, and for
// the monitor of every kind. Counts what a monitor allocates. Prints what it tried.
#include "estimator.hpp"

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>

#include "free_motion.hpp"
#include "hard_numbers.hpp"
#include "monitor.hpp"

// They are a pair: malloc and free.
#pragma GCC diagnostic ignored "-Wmismatched-new-delete"
static long allocations = 0;
void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size ? size : 1)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }

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

FreeSettings free_settings(Random& random, std::size_t n, std::size_t columns) {
  return {uniforms(random, n, 1, 20),
          uniforms(random, n * columns, 0, 1),
          uniforms(random, n, 0.1, 5),
          uniform(random, 0, 2),
          uniform(random, 0, 0.2),
          {uniforms(random, n, 0.1, 1), uniforms(random, n, 0, 1), uniforms(random, n, 0.1, 1),
           uniforms(random, 4 * n, 0, 1), uniforms(random, n, 0, 1)}};
}

int free_motions(Random& random, int rounds) {
  constexpr std::size_t samples = 500;
  for (int round = 0; round < 10 * rounds; ++round) {
    const std::size_t n = 1 + random() % 7;
    const FrictionBasis basis = basis_of(random, n);
    const FreeSettings set = free_settings(random, n, basis.columns());
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

// The three kinds of streams that are native, of one arm.
std::shared_ptr<Scores> scores_of(Random& random, int kind, const Chain& chain,
                                  const FrictionBasis& basis) {
  const std::size_t n = chain.joints.size();
  if (kind == 0)
    return std::make_shared<FreeScores>(
        FreeMotion(chain, basis, free_settings(random, n, basis.columns())));
  std::vector<std::int64_t> joints;
  for (std::size_t j = 0; j < n; ++j) joints.push_back(static_cast<std::int64_t>(n - 1 - j));
  const Numbers weights = random() % 2 ? Numbers{} : uniforms(random, 4 * n, 0.1, 1);
  Estimator estimator(chain, basis, settings_of(random, n, basis.columns(), true));
  ScaledResidual residual(std::move(estimator), Scaling(joints, weights, 1, 0.5, random() % 2));
  if (kind == 1)
    return std::make_shared<LimitScores>(std::move(residual), uniforms(random, n, 0.1, 2));
  const std::size_t count = 1 + random() % 11, size = n * count, vectors = random() % 40;
  const Numbers z = uniforms(random, vectors * size, -1, 1), c = uniforms(random, vectors, -1, 1);
  return std::make_shared<KernelScores>(std::move(residual), Window(n, 1 + random() % 8, count),
                                        KernelSum(z.data(), c.data(), vectors, size, 0.1, 3));
}

struct Watch {
  Watch(std::uint64_t seed, int kind)
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
    Alarm alarm(scores_of(random, kind, chain, basis), {dt, 0.1, 0.5, 2, 250, levels});
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

// Motion with packets that are late, missing, repeated, of another clock, and numbers that are
// none: such samples are faults, every answer is one, and nothing is allocated on the way.
int monitors(Random& random, int rounds) {
  constexpr int samples = 2000;
  const double strange[] = {std::nan(""), std::numeric_limits<double>::infinity(), 1e300, -1e300,
                            50};
  for (int round = 0; round < 3 * rounds; ++round) {
    const std::uint64_t seed = random();
    Watch watch(seed, round % 3), twin(seed, round % 3);
    Numbers q(watch.n), qd(watch.n), current(watch.n);
    double t = 0;
    for (int k = 0; k < samples; ++k) {
      const auto kind = random() % 100;
      t += kind < 4    ? Watch::dt * double(random() % 12)
           : kind == 4 ? -hard_number(random)
                       : Watch::dt;
      if (!std::isfinite(t) || std::fabs(t) > 1e5) t = 0;
      for (std::size_t j = 0; j < watch.n; ++j) {
        const double phase = Watch::dt * k + double(j);
        q[j] = std::sin(phase), qd[j] = std::cos(phase), current[j] = uniform(random, -3, 3);
      }
      Numbers* parts[] = {&qd, &current};
      if (kind > 94) (*parts[random() % 2])[random() % watch.n] = strange[random() % 5];
      const double at = kind == 94 ? strange[random() % 2] : t;
      const long before = allocations;
      const Thought said = watch.monitor->step(at, q.data(), qd.data(), current.data());
      check(allocations == before, "a monitor allocates");
      const Thought again = twin.monitor->step(at, q.data(), qd.data(), current.data());
      check(said.state == again.state && !std::memcmp(&said.score, &again.score, 8),
            "two monitors of one stream differ");
      check(std::isfinite(said.score), "a score that is no number");
      check(kind < 94 || (said.why.fault != Fault::none && said.state != State::free),
            "a sample that is no number passes");
      check(said.state != State::collision || said.alarm, "a collision without an alarm");
    }
  }
  return 3 * rounds * samples;
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  Random random(5);
  const int estimated = estimators(random, effort), judged = free_motions(random, effort),
            watched = monitors(random, effort);
  std::printf("estimator samples %d, free-motion samples %d, monitor samples %d: %d wrong\n",
              estimated, judged, watched, failures);
  return failures != 0;
}
