// The boxes are sorted along a space-filling curve (Morton 1966) and grouped by eight. Eight groups
// have a box around them, and so on up to one root (as in linear hierarchies: Lauterbach et al.
// 2009). Each group of eight bodies is searched for in this tree, among the groups after it.
#include "broad_phase.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {
namespace {

constexpr int eight = 8;

using namespace geometry;  // lanes.hpp

float down(double x) { return std::nextafter(static_cast<float>(x), -INFINITY); }
float up(double x) { return std::nextafter(static_cast<float>(x), INFINITY); }

struct FloatRange {
  float low[3], high[3];
};

// Eight boxes, rounded outward.
struct alignas(32) Block {
  float low[3][eight], high[3][eight];
  void clear() {
    for (int k = 0; k < 3; ++k)
      for (int s = 0; s < eight; ++s) low[k][s] = INFINITY, high[k][s] = -INFINITY;
  }
  void set(int s, const FloatRange& box) {
    for (int k = 0; k < 3; ++k) low[k][s] = box.low[k], high[k][s] = box.high[k];
  }
  FloatRange around() const {
    FloatRange all;
    for (int k = 0; k < 3; ++k) {
      all.low[k] = *std::min_element(low[k], low[k] + eight);
      all.high[k] = *std::max_element(high[k], high[k] + eight);
    }
    return all;
  }
};

TAUGUARD_INLINE unsigned lanes_of(const Block& block, const float* low, const float* high) {
  const Float8* lows = reinterpret_cast<const Float8*>(block.low);
  const Float8* highs = reinterpret_cast<const Float8*>(block.high);
  Mask8 hit = (Mask8){} - 1;
  for (int k = 0; k < 3; ++k) hit &= (Mask8)(lows[k] <= high[k]) & (Mask8)(highs[k] >= low[k]);
  return bits8(hit);
}

// Bit s is set if box s of the block overlaps `box`.
TAUGUARD_CLONES unsigned overlapping(const Block& block, const FloatRange& box) {
  return lanes_of(block, box.low, box.high);
}

// Bit s of out[i] is set if box s of `y` overlaps box i of `x`.
TAUGUARD_CLONES void all_overlapping(const Block& x, const Block& y, unsigned* out) {
  for (int i = 0; i < eight; ++i) {
    const float low[3] = {x.low[0][i], x.low[1][i], x.low[2][i]},
                high[3] = {x.high[0][i], x.high[1][i], x.high[2][i]};
    out[i] = lanes_of(y, low, high);
  }
}

bool overlap(const Range3& x, const Range3& y) {
  bool all = true;
  for (int k = 0; k < 3; ++k) all &= x.low[k] <= y.high[k] && x.high[k] >= y.low[k];
  return all;
}

// Spreads the lowest 21 bits of x, two zeros between each.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

class Tree8 {
 public:
  Tree8(const Range3* boxes, std::size_t n) : boxes_(boxes), order_(n) {
    sort(boxes, n);
    levels_.emplace_back((n + eight - 1) / eight);
    for (auto& block : levels_[0]) block.clear();
    for (std::size_t i = 0; i < n; ++i)
      levels_[0][i / eight].set(i % eight, outward(boxes[order_[i]]));
    while (levels_.back().size() > 1) {
      const std::vector<Block>& below = levels_.back();
      std::vector<Block> above((below.size() + eight - 1) / eight);
      for (auto& block : above) block.clear();
      for (std::size_t i = 0; i < below.size(); ++i)
        above[i / eight].set(i % eight, below[i].around());
      levels_.push_back(std::move(above));
    }
  }
  std::size_t groups() const { return levels_[0].size(); }

  // Adds the pairs of a group with itself and with later groups.
  void search(std::size_t group, std::vector<std::int32_t>& pairs) const {
    const FloatRange around = levels_[0][group].around();
    struct Open {
      std::size_t level, block;
    };
    std::vector<Open> stack = {{levels_.size() - 1, 0}};
    while (!stack.empty()) {
      const Open open = stack.back();
      stack.pop_back();
      if (open.level == 0) {
        meet(group, open.block, pairs);
        continue;
      }
      const std::size_t below = open.level - 1, shift = 3 * below;
      for (unsigned mask = overlapping(levels_[open.level][open.block], around); mask;
           mask &= mask - 1) {
        const std::size_t child = eight * open.block + __builtin_ctz(mask);
        // An infinite box also overlaps the empty ones that fill up a block.
        if (((child + 1) << shift) > group && child < levels_[below].size())
          stack.push_back({below, child});
      }
    }
  }

 private:
  void meet(std::size_t a, std::size_t b, std::vector<std::int32_t>& pairs) const {
    if (b < a) return;
    unsigned masks[eight];
    all_overlapping(levels_[0][a], levels_[0][b], masks);
    const std::size_t rest = order_.size() - eight * b, own = order_.size() - eight * a;
    const unsigned all = rest < eight ? (1u << rest) - 1 : 0xff;
    for (int s = 0; s < eight && static_cast<std::size_t>(s) < own; ++s) {
      unsigned mask = masks[s] & all;
      if (a == b) mask &= ~0u << (s + 1);
      for (; mask; mask &= mask - 1) {
        const std::int32_t i = order_[eight * a + s], j = order_[eight * b + __builtin_ctz(mask)];
        if (!overlap(boxes_[i], boxes_[j])) continue;
        pairs.push_back(std::min(i, j)), pairs.push_back(std::max(i, j));
      }
    }
  }

  static FloatRange outward(const Range3& box) {
    FloatRange out;
    for (int k = 0; k < 3; ++k) out.low[k] = down(box.low[k]), out.high[k] = up(box.high[k]);
    return out;
  }

  void sort(const Range3* boxes, std::size_t n) {
    double low[3], scale[3];
    const auto middle = [&](std::size_t i, int k) {
      const double x = 0.5 * boxes[i].low[k] + 0.5 * boxes[i].high[k];
      return std::isfinite(x) ? x : 0.0;
    };
    for (int k = 0; k < 3; ++k) {
      double least = HUGE_VAL, most = -HUGE_VAL;
      for (std::size_t i = 0; i < n; ++i)
        least = std::min(least, middle(i, k)), most = std::max(most, middle(i, k));
      low[k] = least;
      const double size = most - least;
      scale[k] = size > 0 && std::isfinite(1 / size) && std::isfinite(size) ? 2097151 / size : 0;
    }
    std::vector<std::pair<std::uint64_t, std::int32_t>> key(n);
    for (std::size_t i = 0; i < n; ++i) {
      std::uint64_t code = 0;
      for (int k = 0; k < 3; ++k)
        code |= spread(static_cast<std::uint64_t>((middle(i, k) - low[k]) * scale[k])) << k;
      key[i] = {code, static_cast<std::int32_t>(i)};
    }
    std::sort(key.begin(), key.end());
    for (std::size_t i = 0; i < n; ++i) order_[i] = key[i].second;
  }

  const Range3* boxes_;
  std::vector<std::int32_t> order_;
  std::vector<std::vector<Block>> levels_;
};

// The pairs in order, by counting the first numbers.
std::vector<std::int32_t> sorted(const std::vector<std::vector<std::int32_t>>& parts,
                                 std::size_t n) {
  std::vector<std::size_t> place(n + 1);
  for (const auto& part : parts)
    for (std::size_t i = 0; i < part.size(); i += 2) ++place[part[i] + 1];
  for (std::size_t i = 0; i < n; ++i) place[i + 1] += place[i];
  std::vector<std::int32_t> second(place[n]), out(2 * place[n]);
  std::vector<std::size_t> next(place.begin(), place.end() - 1);
  for (const auto& part : parts)
    for (std::size_t i = 0; i < part.size(); i += 2) second[next[part[i]]++] = part[i + 1];
  for (std::size_t i = 0; i < n; ++i) {
    std::sort(second.begin() + place[i], second.begin() + place[i + 1]);
    for (std::size_t k = place[i]; k < place[i + 1]; ++k)
      out[2 * k] = static_cast<std::int32_t>(i), out[2 * k + 1] = second[k];
  }
  return out;
}

}  // namespace

Range3 bounds_of(const Bodies& bodies, std::size_t row, double radius) {
  Range3 out;
  const double* p = bodies.row(row);
  double magnitude = radius;
  const bool round = bodies.kind == Kind::ellipsoids || bodies.kind == Kind::cylinders;
  if (round) {
    // A cylinder has the sizes radius, half length; an ellipsoid its three half axes.
    for (int k = 0; k < 3; ++k) {
      const double* axes = p + 6 + 3 * k;
      const double x = axes[0] * p[3], y = axes[1] * (bodies.kind == Kind::cylinders ? p[3] : p[4]),
                   z = axes[2] * (bodies.kind == Kind::cylinders ? p[4] : p[5]);
      const double half = bodies.kind == Kind::cylinders ? std::sqrt(x * x + y * y) + std::fabs(z)
                                                         : std::sqrt(x * x + y * y + z * z);
      out.low[k] = p[k] - half, out.high[k] = p[k] + half;
      magnitude += std::fabs(p[k]) + half;
    }
  } else {
    for (int k = 0; k < 3; ++k) out.low[k] = HUGE_VAL, out.high[k] = -HUGE_VAL;
    for (const Vec3& v : vertices_of<double>(bodies, row))
      for (int k = 0; k < 3; ++k)
        out.low[k] = std::min(out.low[k], v[k]), out.high[k] = std::max(out.high[k], v[k]);
    for (int k = 0; k < 3; ++k)
      magnitude += std::max(std::fabs(out.low[k]), std::fabs(out.high[k]));
  }
  const double slack = radius + 0x1p-48 * magnitude;
  for (int k = 0; k < 3; ++k) out.low[k] -= slack, out.high[k] += slack;
  return out;
}

std::vector<std::int32_t> overlapping_boxes(const Range3* boxes, std::size_t n, double by,
                                            int threads) {
  if (n == 0) return {};
  std::vector<Range3> grown(by > 0 ? boxes : nullptr, by > 0 ? boxes + n : nullptr);
  for (Range3& box : grown)
    for (int k = 0; k < 3; ++k) {  // rounding of the sums is included
      box.low[k] -= by + 0x1p-50 * (std::fabs(box.low[k]) + by);
      box.high[k] += by + 0x1p-50 * (std::fabs(box.high[k]) + by);
    }
  const Tree8 tree(by > 0 ? grown.data() : boxes, n);
  constexpr std::size_t grain = 64;
  std::vector<std::vector<std::int32_t>> parts((tree.groups() + grain - 1) / grain);
  geometry::interruptible_for(tree.groups(), threads, grain, [&](auto begin, auto end, auto chunk) {
    for (auto g = begin; g < end; ++g) {
      geometry::poll_interrupt();
      tree.search(g, parts[chunk]);
    }
  });
  return sorted(parts, n);
}

}  // namespace tauguard::rigid
