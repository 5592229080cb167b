// Whether two vertex hulls share a point: either the origin is in conv{a_i - b_j}, or a plane
// separates it from this set. Phase one of the simplex method decides, with 4 rows (three
// coordinates and the sum of weights) and a basis of 4 columns. All quantities are cofactors of the
// basis, so there is no division. With Dyadic the answer is exact for any finite coordinates, also
// for degenerate bodies. The entering column is chosen by Dantzig's rule at first, and after 24
// steps by Bland's rule (1977), which cannot cycle.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/rigid/bodies.hpp"

namespace tauguard::rigid {

inline int sign_of(const Dyadic& x) { return x.sign(); }
inline int sign_of(double x) { return (x > 0) - (x < 0); }

// Whether x > y, where both are sums of terms of size `scale`. In doubles there is a margin:
// columns of the basis have prices of zero up to rounding, and must not enter again.
inline bool exceeds(const Dyadic& x, const Dyadic& y, const Dyadic&) { return y < x; }
inline bool exceeds(double x, double y, double scale) { return x - y > 0x1p-46 * scale; }
inline void grow(Dyadic&, const Dyadic&) {}
inline void grow(double& scale, double x) { scale = std::fmax(scale, std::fabs(x)); }

template <class Number>
class HullSimplex {
 public:
  enum class Answer { common, separated, gave_up };

  HullSimplex(const Points<Number>& a, const Points<Number>& b) : a_(a), b_(b) {}

  Answer solve(int limit = 1 << 30) {
    start();
    for (int step = 0; step < limit; ++step) {
      geometry::poll_interrupt();
      factor();
      if (sign_of(determinant_) == 0)
        return Answer::gave_up;  // only with doubles: in exact arithmetic every basis is regular
      multipliers();
      if (sign_of(y_[3]) <= 0) return Answer::common;  // no artificial weight is left
      std::size_t i = 0, j = 0;
      if (!price(step >= 24, i, j)) return Answer::separated;
      if (!exchange(i, j)) return Answer::gave_up;
    }
    return Answer::gave_up;
  }

  // If `separated`: y . (a_i - b_j) <= -y[3] < 0 for all pairs, up to a positive factor.
  const std::array<Number, 4>& plane() const { return y_; }
  // If `common`: the weight of basis column k, times `determinant`. Column k is a_i - b_j with
  // basis_pair(k) = {i, j}, or artificial if is_artificial(k).
  const Number& weight(int k) const { return adjugate_[k][3]; }
  const Number& determinant() const { return determinant_; }
  bool is_artificial(int k) const { return basis_[k] < 3; }
  std::array<std::size_t, 2> basis_pair(int k) const {
    return {(basis_[k] - 3) / b_.size(), (basis_[k] - 3) % b_.size()};
  }
  Vector3<Number> column(std::size_t i, std::size_t j) const { return a_[i] - b_[j]; }

 private:
  void set_column(int k, std::size_t variable) {
    basis_[k] = variable;
    if (variable < 3) {
      for (std::size_t r = 0; r < 4; ++r) m_[r][k] = Number(r == variable ? side_[r] : 0.0);
      return;
    }
    const auto q = column((variable - 3) / b_.size(), (variable - 3) % b_.size());
    for (int r = 0; r < 3; ++r) m_[r][k] = q[r];
    m_[3][k] = Number(1.0);
  }

  // The first basis: one pair of vertices and three artificial unit columns with signs that make
  // weights >= 0.
  void start() {
    const auto q = column(0, 0);
    for (int r = 0; r < 3; ++r) side_[r] = sign_of(q[r]) > 0 ? -1.0 : 1.0;
    for (std::size_t r = 0; r < 3; ++r) set_column(static_cast<int>(r), r);
    set_column(3, 3);
  }

  // Adjugate and determinant of the basis, from 2 x 2 minors of its upper and lower halves.
  void factor() {
    const auto& m = m_;
    const auto minor = [&](int r, int c, int d) {
      return m[r][c] * m[r + 1][d] - m[r][d] * m[r + 1][c];
    };
    const Number s0 = minor(0, 0, 1), s1 = minor(0, 0, 2), s2 = minor(0, 0, 3), s3 = minor(0, 1, 2),
                 s4 = minor(0, 1, 3), s5 = minor(0, 2, 3);
    const Number c0 = minor(2, 0, 1), c1 = minor(2, 0, 2), c2 = minor(2, 0, 3), c3 = minor(2, 1, 2),
                 c4 = minor(2, 1, 3), c5 = minor(2, 2, 3);
    determinant_ = s0 * c5 - s1 * c4 + s2 * c3 + s3 * c2 - s4 * c1 + s5 * c0;
    auto& v = adjugate_;
    const auto row = [&](int k, int r, const Number& x, int p, const Number& y, int q,
                         const Number& z, int w, bool negative) {
      const Number t = m[r][p] * x - m[r][q] * y + m[r][w] * z;
      v[k][other(r)] = negative ? -t : t;
    };
    row(0, 1, c5, 1, c4, 2, c3, 3, false), row(0, 0, c5, 1, c4, 2, c3, 3, true);
    row(0, 3, s5, 1, s4, 2, s3, 3, false), row(0, 2, s5, 1, s4, 2, s3, 3, true);
    row(1, 1, c5, 0, c2, 2, c1, 3, true), row(1, 0, c5, 0, c2, 2, c1, 3, false);
    row(1, 3, s5, 0, s2, 2, s1, 3, true), row(1, 2, s5, 0, s2, 2, s1, 3, false);
    row(2, 1, c4, 0, c2, 1, c0, 3, false), row(2, 0, c4, 0, c2, 1, c0, 3, true);
    row(2, 3, s4, 0, s2, 1, s0, 3, false), row(2, 2, s4, 0, s2, 1, s0, 3, true);
    row(3, 1, c3, 0, c1, 1, c0, 2, true), row(3, 0, c3, 0, c1, 1, c0, 2, false);
    row(3, 3, s3, 0, s1, 1, s0, 2, true), row(3, 2, s3, 0, s1, 1, s0, 2, false);
    if (sign_of(determinant_) >= 0) return;
    determinant_ = -determinant_;
    for (auto& r : v)
      for (auto& x : r) x = -x;
  }

  // The other row of the half (rows 0 and 1, or 2 and 3) that contains row r.
  static int other(int r) { return r ^ 1; }

  void multipliers() {
    for (int c = 0; c < 4; ++c) {
      y_[c] = Number();
      for (int k = 0; k < 4; ++k)
        if (is_artificial(k)) y_[c] += adjugate_[k][c];
    }
  }

  Number project(const Vector3<Number>& p) const {
    return y_[0] * p[0] + y_[1] * p[1] + y_[2] * p[2];
  }

  // Finds a column a_i - b_j that lowers the artificial weight: the steepest one, or if `first` the
  // first one (Bland's rule). False if there is none.
  bool price(bool first, std::size_t& i, std::size_t& j) {
    std::vector<Number>& pa = project_a_;
    std::vector<Number>& pb = project_b_;
    pa.clear(), pb.clear();
    for (const auto& p : a_) pa.push_back(project(p));
    for (const auto& p : b_) pb.push_back(project(p) - y_[3]);
    Number scale{};
    for (const auto& x : pa) grow(scale, x);
    for (const auto& x : pb) grow(scale, x);
    if (first) {
      for (i = 0; i < pa.size(); ++i) {
        geometry::poll_interrupt();
        for (j = 0; j < pb.size(); ++j)
          if (exceeds(pa[i], pb[j], scale)) return true;
      }
      return false;
    }
    i = j = 0;
    for (std::size_t k = 1; k < pa.size(); ++k)
      if (pa[i] < pa[k]) i = k;
    for (std::size_t k = 1; k < pb.size(); ++k)
      if (pb[k] < pb[j]) j = k;
    return exceeds(pa[i], pb[j], scale);
  }

  bool exchange(std::size_t i, std::size_t j) {
    const auto q = column(i, j);
    int leaving = -1;
    Number best;
    for (int k = 0; k < 4; ++k) {
      const auto& v = adjugate_[k];
      const Number w = v[0] * q[0] + v[1] * q[1] + v[2] * q[2] + v[3];
      if (sign_of(w) <= 0) continue;
      if (leaving >= 0) {
        const int order = sign_of(weight(k) * best - weight(leaving) * w);
        if (order > 0 || (order == 0 && basis_[k] > basis_[leaving])) continue;
      }
      leaving = k;
      best = w;
    }
    if (leaving < 0) return false;
    set_column(leaving, 3 + i * b_.size() + j);
    return true;
  }

  const Points<Number>& a_;
  const Points<Number>& b_;
  std::array<double, 3> side_{};
  std::array<std::size_t, 4> basis_{};
  std::array<std::array<Number, 4>, 4> m_, adjugate_;
  std::array<Number, 4> y_;
  Number determinant_{};
  std::vector<Number> project_a_, project_b_;
};

}  // namespace tauguard::rigid
