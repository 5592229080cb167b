// Exact arithmetic on dyadic rationals m * 2^e. Every finite double is a dyadic rational, and so
// are sums, differences and products of dyadic rationals. The sign of a polynomial is therefore
// exact for any finite input, without overflow or underflow and in every rounding mode. A product
// takes tens of nanoseconds, so kernels try a floating-point filter first.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "tauguard/geometry/limbs.hpp"

namespace tauguard::geometry {

class Dyadic {
 public:
  Dyadic() = default;

  // Exact; x must be finite.
  explicit Dyadic(double x) {
    if (x == 0.0) return;
    int exponent = 0;
    const double fraction = std::frexp(std::fabs(x), &exponent);  // in [0.5, 1)
    const auto mantissa = static_cast<std::uint64_t>(std::ldexp(fraction, 53));
    sign_ = x < 0 ? -1 : 1;
    exponent_ = exponent - 53;
    limbs_ = {mantissa};
    normalize();
  }

  static Dyadic from_int(std::int64_t x) {
    Dyadic r;
    if (x == 0) return r;
    const std::uint64_t m =
        x < 0 ? ~static_cast<std::uint64_t>(x) + 1 : static_cast<std::uint64_t>(x);
    r.sign_ = x < 0 ? -1 : 1;
    r.limbs_ = {m};
    r.normalize();
    return r;
  }

  int sign() const { return sign_; }
  bool is_zero() const { return sign_ == 0; }

  Dyadic operator-() const {
    Dyadic r = *this;
    r.sign_ = -sign_;
    return r;
  }

  friend Dyadic operator+(const Dyadic& a, const Dyadic& b) {
    if (a.is_zero()) return b;
    if (b.is_zero()) return a;
    const std::int64_t exponent = std::min(a.exponent_, b.exponent_);
    const Shifted x(a, exponent), y(b, exponent);
    Dyadic r;
    r.exponent_ = exponent;
    if (a.sign_ == b.sign_) {
      add(x, y, r.limbs_);
      r.sign_ = a.sign_;
    } else {
      const int order = compare_magnitude(x, y);
      if (order == 0) return Dyadic();
      subtract(order > 0 ? x : y, order > 0 ? y : x, r.limbs_);
      r.sign_ = order > 0 ? a.sign_ : b.sign_;
    }
    r.normalize();
    return r;
  }

  friend Dyadic operator-(const Dyadic& a, const Dyadic& b) { return a + (-b); }

  friend Dyadic operator*(const Dyadic& a, const Dyadic& b) {
    if (a.is_zero() || b.is_zero()) return Dyadic();
    Dyadic r;
    r.sign_ = a.sign_ * b.sign_;
    r.exponent_ = a.exponent_ + b.exponent_;
    r.limbs_.assign(a.limbs_.size() + b.limbs_.size(), 0);
    for (std::size_t i = 0; i < a.limbs_.size(); ++i) {
      std::uint64_t carry = 0;
      for (std::size_t j = 0; j < b.limbs_.size(); ++j) {
        const Wide t = Wide{a.limbs_[i]} * b.limbs_[j] + r.limbs_[i + j] + carry;
        r.limbs_[i + j] = static_cast<std::uint64_t>(t);
        carry = static_cast<std::uint64_t>(t >> 64);
      }
      r.limbs_[i + b.limbs_.size()] = carry;
    }
    r.normalize();
    return r;
  }

  Dyadic& operator+=(const Dyadic& o) { return *this = *this + o; }
  Dyadic& operator-=(const Dyadic& o) { return *this = *this - o; }
  Dyadic& operator*=(const Dyadic& o) { return *this = *this * o; }

  // Multiplication by 2^k, exact and free.
  Dyadic scaled(std::int64_t k) const {
    Dyadic r = *this;
    if (!r.is_zero()) r.exponent_ += k;
    return r;
  }

  friend int compare(const Dyadic& a, const Dyadic& b) { return (a - b).sign(); }
  friend bool operator<(const Dyadic& a, const Dyadic& b) { return compare(a, b) < 0; }
  friend bool operator<=(const Dyadic& a, const Dyadic& b) { return compare(a, b) <= 0; }
  friend bool operator==(const Dyadic& a, const Dyadic& b) { return compare(a, b) == 0; }

  // The e with 2^e <= |x| < 2^(e + 1); x must not be zero.
  std::int64_t floor_log2() const {
    return exponent_ + 64 * static_cast<std::int64_t>(limbs_.size()) - 1 -
           __builtin_clzll(limbs_.back());
  }

  // The value truncated towards zero to 53 bits; +-inf or 0 outside the range of double.
  double to_double() const {
    if (is_zero()) return 0.0;
    const std::size_t n = limbs_.size();
    const int lead = __builtin_clzll(limbs_.back());
    std::uint64_t head = limbs_.back() << lead;
    if (lead && n > 1) head |= limbs_[n - 2] >> (64 - lead);
    head >>= 11;
    const std::int64_t shift = exponent_ + 64 * static_cast<std::int64_t>(n - 1) + 11 - lead;
    const std::int64_t bounded = std::clamp<std::int64_t>(shift, -5000, 5000);
    return sign_ * std::ldexp(static_cast<double>(head), static_cast<int>(bounded));
  }

 private:
  void normalize() {
    while (!limbs_.empty() && limbs_.back() == 0) limbs_.pop_back();
    if (limbs_.empty()) {
      sign_ = 0;
      exponent_ = 0;
      return;
    }
    std::size_t zeros = 0;
    while (limbs_[zeros] == 0) ++zeros;
    if (zeros) {
      limbs_.drop_front(zeros);
      exponent_ += 64 * static_cast<std::int64_t>(zeros);
    }
  }

  // A view of the limbs of `a` in units of 2^exponent, for exponent <= a.exponent_.
  class Shifted {
   public:
    Shifted(const Dyadic& a, std::int64_t exponent)
        : limbs_(a.limbs_.data()),
          count_(a.limbs_.size()),
          zeros_(static_cast<std::size_t>((a.exponent_ - exponent) / 64)),
          bits_(static_cast<int>((a.exponent_ - exponent) % 64)) {}
    std::size_t size() const { return zeros_ + count_ + (bits_ != 0); }
    std::uint64_t operator[](std::size_t i) const {
      if (i < zeros_) return 0;
      i -= zeros_;
      const std::uint64_t high = i < count_ ? limbs_[i] : 0,
                          low = i > 0 && i <= count_ ? limbs_[i - 1] : 0;
      return bits_ ? high << bits_ | low >> (64 - bits_) : high;
    }

   private:
    const std::uint64_t* limbs_;
    std::size_t count_, zeros_;
    int bits_;
  };

  static void add(const Shifted& x, const Shifted& y, Limbs& r) {
    const std::size_t n = std::max(x.size(), y.size()) + 1;
    r.assign(n, 0);
    std::uint64_t* out = r.data();
    Wide carry = 0;
    for (std::size_t i = 0; i < n; ++i) {
      carry += Wide{x[i]} + y[i];
      out[i] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
  }

  // x - y for x >= y.
  static void subtract(const Shifted& x, const Shifted& y, Limbs& r) {
    const std::size_t n = x.size();
    r.assign(n, 0);
    std::uint64_t* out = r.data();
    bool borrow = false;
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint64_t a = x[i], b = y[i], t = a - b - borrow;
      borrow = a < b || (a == b && borrow);
      out[i] = t;
    }
  }

  static int compare_magnitude(const Shifted& x, const Shifted& y) {
    for (std::size_t i = std::max(x.size(), y.size()); i-- > 0;)
      if (x[i] != y[i]) return x[i] > y[i] ? 1 : -1;
    return 0;
  }

  using Wide = unsigned __int128;

  int sign_ = 0;
  std::int64_t exponent_ = 0;
  Limbs limbs_;  // little endian, no zero limb at either end
};

}  // namespace tauguard::geometry
