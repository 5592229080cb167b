// Signed integers in two's complement, of a width that is known at compile time. They give exact
// signs without allocations and without loops of unknown length. The width of a product is the sum
// of the factors' widths, so a product always fits. The caller ensures that a sum fits.
#pragma once

#include <array>
#include <cstdint>

namespace tauguard::geometry {

template <int limbs>
struct FixedInt {
  std::array<std::uint64_t, limbs> limb{};  // least significant first

  FixedInt() = default;
  explicit FixedInt(std::int64_t x) {
    limb.fill(x < 0 ? ~std::uint64_t{0} : 0);
    limb[0] = static_cast<std::uint64_t>(x);
  }
  // The same value, wider.
  template <int narrow>
  explicit FixedInt(const FixedInt<narrow>& x) {
    static_assert(narrow <= limbs);
    limb.fill(x.negative() ? ~std::uint64_t{0} : 0);
    for (int i = 0; i < narrow; ++i) limb[i] = x.limb[i];
  }

  bool negative() const { return limb[limbs - 1] >> 63; }
  int sign() const {
    if (negative()) return -1;
    std::uint64_t any = 0;
    for (const auto l : limb) any |= l;
    return any != 0;
  }

  friend FixedInt operator+(const FixedInt& a, const FixedInt& b) {
    FixedInt r;
    unsigned __int128 carry = 0;
    for (int i = 0; i < limbs; ++i) {
      carry += a.limb[i];
      carry += b.limb[i];
      r.limb[i] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
    return r;
  }
  FixedInt operator-() const {
    FixedInt r;
    std::uint64_t carry = 1;
    for (int i = 0; i < limbs; ++i) {
      r.limb[i] = ~limb[i] + carry;
      carry = carry && r.limb[i] == 0;
    }
    return r;
  }
  friend FixedInt operator-(const FixedInt& a, const FixedInt& b) { return a + -b; }
  friend bool operator==(const FixedInt& a, const FixedInt& b) { return a.limb == b.limb; }

  FixedInt magnitude() const { return negative() ? -*this : *this; }

  // Bits beyond the width of the type are lost, in `times` and in `shifted`.
  FixedInt times(std::uint64_t k) const {
    FixedInt r;
    std::uint64_t carry = 0;
    for (int i = 0; i < limbs; ++i) {
      const auto t = static_cast<unsigned __int128>(limb[i]) * k + carry;
      r.limb[i] = static_cast<std::uint64_t>(t);
      carry = static_cast<std::uint64_t>(t >> 64);
    }
    return r;
  }

  // x * 2^shift, for 0 <= shift < 64 * limbs.
  FixedInt shifted(int shift) const {
    FixedInt r;
    const int whole = shift / 64, bits = shift % 64;
    for (int i = limbs - 1; i >= whole; --i) {
      r.limb[i] = limb[i - whole] << bits;
      if (bits && i > whole) r.limb[i] |= limb[i - whole - 1] >> (64 - bits);
    }
    return r;
  }

  // The relative error is about 2^-52.
  double to_double() const {
    const FixedInt m = magnitude();
    double sum = 0;
    for (int i = limbs - 1; i >= 0; --i) sum = sum * 0x1p64 + static_cast<double>(m.limb[i]);
    return negative() ? -sum : sum;
  }
};

template <int n, int m>
FixedInt<n + m> operator*(const FixedInt<n>& a, const FixedInt<m>& b) {
  const FixedInt<n> x = a.magnitude();
  const FixedInt<m> y = b.magnitude();
  FixedInt<n + m> r;
  for (int i = 0; i < n; ++i) {
    std::uint64_t carry = 0;
    for (int j = 0; j < m; ++j) {
      const auto t = static_cast<unsigned __int128>(x.limb[i]) * y.limb[j] + r.limb[i + j] + carry;
      r.limb[i + j] = static_cast<std::uint64_t>(t);
      carry = static_cast<std::uint64_t>(t >> 64);
    }
    r.limb[i + m] = carry;
  }
  return a.negative() != b.negative() ? -r : r;
}

}  // namespace tauguard::geometry
