// What a fuzz target reads off libFuzzer's bytes: choices of one byte, and numbers of one byte that
// says how they are made and what that needs. After the end of the bytes there are zeros.
// corpus.py writes the hard cases in this form.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>

// An answer that is wrong ends the run, and libFuzzer keeps its bytes.
inline void require(bool right, const char* what) {
  if (right) return;
  std::fprintf(stderr, "wrong: %s\n", what);
  std::abort();
}

class Input {
 public:
  Input(const std::uint8_t* bytes, std::size_t size) : next_(bytes), end_(bytes + size) {}

  std::uint8_t byte() { return next_ < end_ ? *next_++ : 0; }
  int choice(int count) { return byte() % count; }
  int between(int low, int high) { return low + choice(high - low + 1); }

  // Any double at all; many are small integers, equal to the one before, or one rounding from it.
  double any() {
    const auto small = [&] { return double(std::int8_t(byte())); };
    switch (choice(8)) {
      case 0:
        return last_ = small();
      case 1:
        return last_ = small() / 16;
      case 2: {
        const double x = small();
        return last_ = std::ldexp(x, std::int8_t(byte()) / 2);
      }
      case 3:
        return last_ = 1e6 + small() * 0x1p-20;
      case 4:
        return last_;
      case 5:
        return last_ = std::nextafter(last_, small());
      default: {
        std::uint8_t raw[8];
        for (auto& b : raw) b = byte();
        std::memcpy(&last_, raw, 8);
        return last_;
      }
    }
  }
  // The same, finite; of one larger than `most` its fraction, of one smaller than `least` nothing.
  double number(double most = 1.7976931348623157e308, double least = 0) {
    any();
    if (!std::isfinite(last_)) last_ = 0;
    int exponent = 0;
    if (std::fabs(last_) > most) last_ = std::frexp(last_, &exponent);
    if (std::fabs(last_) < least) last_ = 0;
    return last_;
  }
  std::vector<double> numbers(std::size_t n, double most = 1.7976931348623157e308,
                              double least = 0) {
    std::vector<double> out(n);
    for (double& x : out) x = number(most, least);
    return out;
  }

  // By a quaternion of any four numbers, into rows `stride` apart; the identity where they give
  // none.
  void rotation(double* rows, int stride) {
    double q[4], length = 0;
    for (double& x : q) x = number(1e3), length += x * x;
    length = std::sqrt(length);
    const bool none = !(length > 1e-3);
    for (double& x : q) x = none ? 0 : x / length;
    if (none) q[3] = 1;
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k) {
        const double around = i == k             ? q[3] * q[3] - 0.5
                              : (i + 1) % 3 == k ? -q[3] * q[3 - i - k]
                                                 : q[3] * q[3 - i - k];
        rows[stride * i + k] = 2 * (q[i] * q[k] + around);
      }
  }

 private:
  const std::uint8_t *next_, *end_;
  double last_ = 0;
};
