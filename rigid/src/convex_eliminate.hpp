// Overlap of vertex hulls, whose facets are not known, by elimination in D = 2 or 3 dimensions.
//
// Choose D + 1 affinely independent vertices of A. The unknowns are the values p_i >= 0 of the
// separating function at these vertices. F_i are the barycentric coordinates of their simplex,
// scaled by its determinant. Every other vertex gives a row of D + 1 entries F_i(b) or -F_i(a):
//   sum p_i F_i(b) < 0      for a vertex b of B,
//   -sum p_i F_i(a) <= 0    for any other vertex a of A.
// To eliminate p_k, each row with a positive entry k is combined with p_k >= 0 and with each row
// that has a negative entry k. The combinations replace these rows; rows with a zero entry k stay.
// So every row is w F(b) - v F(a), for a point b of B, a point a of A, and w, v >= 0. After s
// eliminations a row is redundant if it is made of more than s + 1 inequalities (Chernikov 1960),
// or if these include all inequalities of another row (Kohler 1967).
//   * If all entries of a row are positive, b lies in the hull of a and the chosen vertices, so the
//     bodies share a point, and no plane exists.
//   * Otherwise back-substitution gives a plane, which is then checked against all vertices. If the
//     check rejects it, the pair is undecided.
// Let E bound the error of every entry. An entry counts as positive if it is above E. To pass this
// test in spite of rounding, combinations leave 2 E instead of 0 as entry k. An entry k from 0 to
// 4 E is too small for that and is treated as zero.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "convex_abfme.hpp"

namespace tauguard::rigid {

template <int D>
class HullElimination {
 public:
  // Points relative to a common origin, of 1-norm at most `reach`; with D = 2 all have z = 0.
  HullElimination(const Points<double>& a, const Points<double>& b, double reach)
      : a_(a), b_(b), reach_(reach) {}

  Verdict decide() {
    if (a_.size() + b_.size() > 100 || !choose_simplex()) return undecided;
    std::vector<Row> rows = initial_rows();
    std::array<std::vector<Row>, D> stages;
    for (int k = 0; k < D; ++k) {
      for (const Row& r : rows)
        if (positive(r)) return common;
      stages[static_cast<std::size_t>(k)] = rows;
      rows = eliminate(rows, k);
      if (rows.size() > 4000) return undecided;
    }
    for (const Row& r : rows)
      if (positive(r)) return common;
    return plane_separates(stages) ? separated : undecided;
  }

 private:
  struct Row {
    std::array<double, D + 1> entry;
    std::array<std::uint64_t, 2> support;  // bit set of the inequalities that the row is made of
  };

  static int count(const std::array<std::uint64_t, 2>& s) {
    return __builtin_popcountll(s[0]) + __builtin_popcountll(s[1]);
  }
  static void add(std::array<std::uint64_t, 2>& s, std::size_t i) {
    s[i / 64] |= std::uint64_t{1} << (i % 64);
  }

  bool positive(const Row& r) const {
    return std::all_of(r.entry.begin(), r.entry.end(), [&](double x) { return x > error_; });
  }

  // Normal of F through the points o, p (and q): F(x) = n . (x - o).
  static Vec3 normal_of(const Vec3& o, const Vec3& p, const Vec3& q) {
    const Vec3 u = p - o;
    if (D == 2) return {-u[1], u[0], 0.0};
    return cross(u, q - o);
  }

  // Chooses D + 1 vertices of A. Each is the farthest from the affine span of those before it.
  bool choose_simplex() {
    chosen_[0] = 0;
    Vec3 along{}, across{};
    for (int i = 1; i <= D; ++i) {
      double best = -1.0;
      for (std::size_t k = 0; k < a_.size(); ++k) {
        const Vec3 x = a_[k] - a_[0];
        double size;
        if (i == 1)
          size = dot(x, x);
        else if (i == 2)
          size = dot(cross(along, x), cross(along, x));
        else
          size = std::fabs(dot(across, x));
        if (size > best) best = size, chosen_[static_cast<std::size_t>(i)] = k;
      }
      const Vec3 x = a_[chosen_[static_cast<std::size_t>(i)]] - a_[0];
      if (i == 1) along = x;
      if (i == 2) across = cross(along, x);
    }
    for (std::size_t i = 0; i <= D; ++i) {
      const auto vertex = [&](std::size_t step) { return a_[chosen_[(i + step) % (D + 1)]]; };
      base_[i] = vertex(1);
      normal_[i] = normal_of(base_[i], vertex(2), D == 3 ? vertex(3) : vertex(2));
      double own = value(i, vertex(0));
      if (own < 0) {
        normal_[i] = -normal_[i];
        own = -own;
      }
      // As tetrahedron_error() in convex_abfme.hpp, but all lengths are bounded by `reach`.
      error_ = 512 * unit * (D == 3 ? reach_ * reach_ * reach_ : reach_ * reach_);
      if (!(own > 8 * error_)) return false;
    }
    return true;
  }

  double value(std::size_t i, const Vec3& x) const { return dot(normal_[i], x - base_[i]); }

  std::vector<Row> initial_rows() const {
    std::vector<Row> rows;
    std::size_t name = D + 1;  // inequalities 0 .. D are p_i >= 0
    const auto push = [&](const Vec3& x, double sign) {
      Row r{};
      for (std::size_t i = 0; i <= D; ++i) r.entry[i] = sign * value(i, x);
      add(r.support, name++);
      rows.push_back(r);
    };
    for (const auto& x : b_) push(x, 1.0);
    for (std::size_t k = 0; k < a_.size(); ++k)
      if (std::find(chosen_.begin(), chosen_.end(), k) == chosen_.end()) push(a_[k], -1.0);
    return rows;
  }

  std::vector<Row> eliminate(const std::vector<Row>& rows, int column) const {
    const auto k = static_cast<std::size_t>(column);
    std::vector<Row> out;
    for (const Row& p : rows) {
      if (!(p.entry[k] > 4 * error_)) continue;
      Row kept = p;
      add(kept.support, k);
      kept.entry[k] = 2 * error_;  // a smaller entry is valid, as p_k >= 0
      out.push_back(kept);
      for (const Row& q : rows) {
        if (!(q.entry[k] < 0)) continue;
        Row r;
        for (int w = 0; w < 2; ++w) r.support[w] = p.support[w] | q.support[w];
        if (count(r.support) > column + 2) continue;
        const double share = (p.entry[k] - 2 * error_) / (p.entry[k] - q.entry[k]);
        for (std::size_t i = 0; i <= D; ++i)
          r.entry[i] = (1 - share) * p.entry[i] + share * q.entry[i];
        out.push_back(r);
      }
    }
    for (const Row& z : rows)  // rows whose entry counts as zero are kept unchanged
      if (z.entry[k] >= 0 && z.entry[k] <= 4 * error_) out.push_back(z);
    return without_supersets(std::move(out));
  }

  static std::vector<Row> without_supersets(std::vector<Row> rows) {
    std::stable_sort(rows.begin(), rows.end(), [](const Row& x, const Row& y) {
      return count(x.support) < count(y.support);
    });
    std::vector<Row> out;
    for (const Row& r : rows) {
      const bool redundant = std::any_of(out.begin(), out.end(), [&](const Row& s) {
        return (s.support[0] & ~r.support[0]) == 0 && (s.support[1] & ~r.support[1]) == 0;
      });
      if (!redundant) out.push_back(r);
    }
    return out;
  }

  // Sets p_D = 1 and each p_k to the middle of the interval that `stages[k]` allows. Checks the
  // plane.
  bool plane_separates(const std::array<std::vector<Row>, D>& stages) const {
    std::array<double, D + 1> p{};
    p[D] = 1.0;
    for (std::size_t k = D; k-- > 0;) {
      double low = 0.0, high = HUGE_VAL;
      for (const Row& r : stages[k]) {
        double rest = 0.0;
        for (std::size_t i = k + 1; i <= D; ++i) rest += p[i] * r.entry[i];
        if (r.entry[k] > 0) high = std::min(high, -rest / r.entry[k]);
        if (r.entry[k] < 0) low = std::max(low, rest / -r.entry[k]);
      }
      p[k] = std::isinf(high) ? 2 * low + 1 : 0.5 * (low + high);
    }
    Vec3 n{};
    for (std::size_t i = 0; i <= D; ++i)
      for (std::size_t c = 0; c < 3; ++c) n[c] -= p[i] * normal_[i][c];
    double high = -HUGE_VAL, low = HUGE_VAL;
    for (const auto& x : a_) high = std::max(high, dot(n.data(), x.data()));
    for (const auto& x : b_) low = std::min(low, dot(n.data(), x.data()));
    return low - high > 16 * unit * norm1(n.data()) * reach_;
  }

  const Points<double>& a_;
  const Points<double>& b_;
  double reach_, error_ = 0.0;
  std::array<std::size_t, D + 1> chosen_{};
  std::array<Vec3, D + 1> base_{}, normal_{};
};

}  // namespace tauguard::rigid
