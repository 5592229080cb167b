// libFuzzer: samples of any numbers on the monitor of a random arm, and on one of the same arm that
// must say the same.
#include "../random_arm.hpp"
#include "input.hpp"

namespace {

using namespace random_arm;

// A time stamp: mostly the usual interval later, sometimes anything.
double next(Input& in, double t) {
  const int kind = in.choice(16);
  if (kind == 0) return in.any();
  return t + MonitoredArm::dt * (kind < 4 ? in.choice(16) - 2 : 1);
}

void judge(const Thought& said, bool known) {
  require(std::isfinite(said.score), "a score that is no number");
  require(known || (said.why.fault != Fault::none && said.state != State::free),
          "a sample that is no number passes");
  require(said.state != State::collision || said.alarm, "a collision without an alarm");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  Input in(bytes, size);
  const std::uint64_t seed = in.byte();
  const int kind = in.choice(3), samples = 16 * in.between(1, 16);
  MonitoredArm arm(seed, kind), twin(seed, kind);
  Numbers sample(3 * arm.n);
  double t = 0;
  for (int k = 0; k < samples; ++k) {
    const double at = next(in, t);
    bool known = std::isfinite(at);
    if (known) t = at;
    for (std::size_t j = 0; j < arm.n; ++j) {
      const double phase = MonitoredArm::dt * k + double(j);
      sample[j] = std::sin(phase), sample[arm.n + j] = std::cos(phase);
    }
    for (int changed = in.choice(4); changed > 0; --changed)
      sample[std::size_t(in.byte()) % sample.size()] = in.any();
    for (const double x : sample) known = known && std::isfinite(x);
    const double *q = sample.data(), *qd = q + arm.n, *current = qd + arm.n;
    const Thought said = arm.monitor->step(at, q, qd, current);
    judge(said, known);
    const Thought again = twin.monitor->step(at, q, qd, current);
    require(said.state == again.state && !std::memcmp(&said.score, &again.score, 8),
            "two monitors of one stream differ");
  }
  return 0;
}
