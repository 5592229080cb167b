// The estimator, the free-motion detector and the monitor without an interpreter, for the
// sanitizers: random arms and friction models, samples of every size that Python lets pass, and for
// the monitor of every kind. Counts what a monitor allocates. Prints what it tried.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <new>

#include "random_arm.hpp"

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

using namespace random_arm;

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
    Numbers residual(n), unexplained(n), motion(motion_numbers * n), first, tau(n),
        column(basis.columns());
    Numbers memory(n * basis.memory()), p(n), beta(n);
    Workspace work(n);
    for (int turn = 0; turn < 2; ++turn) {
      Numbers all;
      estimator.reset();
      for (std::size_t k = 0; k < samples; ++k) {
        const double *q = &m.q[k * n], *qd = &m.qd[k * n], *current = &m.current[k * n];
        estimator.step(q, qd, current, m.dt[k], residual.data(), unexplained.data(), motion.data());
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

// What an estimator takes from another one of its arm is what it would compute, also if the other
// missed samples, began later, or is of another arm.
int companions(Random& random, int rounds) {
  constexpr std::size_t samples = 300;
  for (int round = 0; round < 10 * rounds; ++round) {
    const std::size_t n = 1 + random() % 7;
    const Chain chain = chain_of(random, n), other_chain = chain_of(random, n);
    const FrictionBasis basis = basis_of(random, n);
    EstimatorSettings set = settings_of(random, n, basis.columns(), true);
    Estimator leader(round % 4 ? chain : other_chain, basis, set);
    set.deviation.assign(set.deviation.size(), 0.0);
    set.gain = uniforms(random, n, 10, 200);
    if (round % 5 == 0) set.weights = uniforms(random, set.weights.size(), 0, 1);
    Estimator alone(chain, basis, set), follower(chain, basis, set);
    follower.compare(leader);
    const Motion m(random, n, samples, round % 2);
    Numbers out[3];
    for (Numbers& o : out) o.resize((2 + motion_numbers) * n);
    for (std::size_t k = 0; k < samples; ++k) {
      const auto step = [&](Estimator& one, Numbers& o, const Estimator* other = nullptr) {
        one.step(&m.q[k * n], &m.qd[k * n], &m.current[k * n], m.dt[k], o.data(), o.data() + n,
                 o.data() + 2 * n, other);
      };
      const bool led = random() % 10 != 0;
      if (random() % 50 == 0) leader.reset();
      if (random() % 50 == 0) alone.reset(), follower.reset();
      if (led) step(leader, out[0]);
      step(alone, out[1]);
      step(follower, out[2], led ? &leader : nullptr);
      check(!std::memcmp(out[1].data(), out[2].data(), 8 * out[1].size()),
            "what it takes from another is not what it computes");
    }
  }
  return 10 * rounds * 300;
}

int free_motions(Random& random, int rounds) {
  constexpr std::size_t samples = 500;
  for (int round = 0; round < 10 * rounds; ++round) {
    const std::size_t n = 1 + random() % 7;
    const FrictionBasis basis = basis_of(random, n);
    FreeMotion stream = free_motion_of(random, chain_of(random, n), basis);
    const bool hard = round % 2;
    const Motion m(random, n, samples, hard);
    Numbers first;
    for (int turn = 0; turn < 2; ++turn) {
      Numbers all;
      stream.reset();
      for (std::size_t k = 0; k < samples; ++k) {
        stream.step(&m.q[k * n], &m.qd[k * n], &m.current[k * n], m.dt[k]);
        all.insert(all.end(), stream.ratio().begin(), stream.ratio().end());
        for (std::size_t j = 0; j < n; ++j) stream.regimes().hides(j);
      }
      if (turn == 0) first = all;
      check(turn == 0 || !std::memcmp(all.data(), first.data(), 8 * all.size()),
            "after a reset it says something else");
      for (const double x : all) check(hard || x >= 0, "a ratio that is none");
    }
  }
  return 10 * rounds * 1000;
}

// Motion with packets that are late, missing, repeated, of another clock, and numbers that are
// none: such samples are faults, every answer is one, and nothing is allocated on the way.
int monitors(Random& random, int rounds) {
  constexpr int samples = 2000;
  const double strange[] = {std::nan(""), std::numeric_limits<double>::infinity(), 1e300, -1e300,
                            50};
  for (int round = 0; round < 3 * rounds; ++round) {
    const std::uint64_t seed = random();
    MonitoredArm arm(seed, round % 3), twin(seed, round % 3);
    Numbers q(arm.n), qd(arm.n), current(arm.n);
    double t = 0;
    for (int k = 0; k < samples; ++k) {
      const auto kind = random() % 100;
      t += kind < 4    ? MonitoredArm::dt * double(random() % 12)
           : kind == 4 ? -hard_number(random)
                       : MonitoredArm::dt;
      if (!std::isfinite(t) || std::fabs(t) > 1e5) t = 0;
      for (std::size_t j = 0; j < arm.n; ++j) {
        const double phase = MonitoredArm::dt * k + double(j);
        q[j] = std::sin(phase), qd[j] = std::cos(phase), current[j] = uniform(random, -3, 3);
      }
      Numbers* parts[] = {&qd, &current};
      if (kind > 94) (*parts[random() % 2])[random() % arm.n] = strange[random() % 5];
      const double at = kind == 94 ? strange[random() % 2] : t;
      const long before = allocations;
      const Thought said = arm.monitor->step(at, q.data(), qd.data(), current.data());
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
  const int estimated = estimators(random, effort) + companions(random, effort),
            judged = free_motions(random, effort), watched = monitors(random, effort);
  std::printf("estimator samples %d, free-motion samples %d, monitor samples %d: %d wrong\n",
              estimated, judged, watched, failures);
  return failures != 0;
}
