#include "hull_index.hpp"

#include <algorithm>

#include "posed_body.hpp"

namespace tauguard::rigid {
namespace {

// The direction at (u, v) in [-1, 1]^2 of a face; face 2 k + s has the component +1 or -1 of axis
// k.
Vec3 direction(int face, double u, double v) {
  Vec3 d{};
  const int axis = face / 2;
  d[axis] = face % 2 ? -1 : 1, d[(axis + 1) % 3] = u, d[(axis + 2) % 3] = v;
  return d;
}

}  // namespace

HullIndex::HullIndex(const double* vertices, std::size_t count)
    : vertices_(vertices),
      count_(count),
      side_(std::clamp(static_cast<int>(std::sqrt(static_cast<double>(count) / 8)), 2, 16)) {
  const Vec3 first = geometry::load(vertices);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 y = geometry::load(vertices + 3 * i);
    reach_ = std::max(reach_, norm(y)), spread_ = std::max(spread_, norm(y - first));
  }
  first_.push_back(0);
  for (int face = 0; face < 6; ++face) add_face(face);
}

// Appends the lists of the cells of a face, row by row.
void HullIndex::add_face(int face) {
  const std::size_t corners = static_cast<std::size_t>(side_) + 1;
  std::vector<double> height[2];  // of each vertex along the corners of two lines of the grid
  std::vector<std::size_t> furthest[2];
  const auto fill = [&](int line) {
    auto& h = height[line % 2];
    h.resize(corners * count_), furthest[line % 2].resize(corners);
    for (std::size_t c = 0; c < corners; ++c) {
      const Vec3 d =
          direction(face, 2.0 * line / side_ - 1, 2.0 * static_cast<double>(c) / side_ - 1);
      double* out = &h[c * count_];
      for (std::size_t i = 0; i < count_; ++i)
        out[i] =
            d[0] * vertices_[3 * i] + d[1] * vertices_[3 * i + 1] + d[2] * vertices_[3 * i + 2];
      furthest[line % 2][c] = std::max_element(out, out + count_) - out;
    }
  };
  // Rounding is far below the margin, which is taken twice for the borders of cells.
  const double slack = 2 * margin();
  fill(0);
  for (int line = 0; line < side_; ++line) {
    fill(line + 1);
    for (int c = 0; c < side_; ++c) {
      const double* h[4];
      std::size_t w[4];
      for (int k = 0; k < 4; ++k) {
        const std::size_t corner = static_cast<std::size_t>(c + k % 2);
        h[k] = &height[(line + k / 2) % 2][corner * count_],
        w[k] = furthest[(line + k / 2) % 2][corner];
      }
      const auto passes = [&](std::size_t i, std::size_t other) {
        return (h[0][i] >= h[0][other] - slack) | (h[1][i] >= h[1][other] - slack) |
               (h[2][i] >= h[2][other] - slack) | (h[3][i] >= h[3][other] - slack);
      };
      for (std::size_t i = 0; i < count_; ++i)
        if (passes(i, w[0]) && passes(i, w[1]) && passes(i, w[2]) && passes(i, w[3]))
          rows_.push_back(static_cast<std::uint32_t>(i));
      first_.push_back(static_cast<std::uint32_t>(rows_.size()));
    }
  }
}

HullIndex::List HullIndex::near(const Vec3& m) const {
  const double x = std::fabs(m[0]), y = std::fabs(m[1]), z = std::fabs(m[2]);
  const int axis = x >= y ? (x >= z ? 0 : 2) : (y >= z ? 1 : 2);
  const double most = std::fabs(m[axis]);
  if (!(most > 0 && most < INFINITY)) return {nullptr, nullptr};
  const double scale = 0.5 * side_ / most, half = 0.5 * side_;
  const int i = std::min(static_cast<int>(m[(axis + 1) % 3] * scale + half), side_ - 1),
            j = std::min(static_cast<int>(m[(axis + 2) % 3] * scale + half), side_ - 1);
  const std::size_t cell =
      static_cast<std::size_t>(((2 * axis + (m[axis] < 0)) * side_ + i) * side_ + j);
  return {&rows_[first_[cell]], &rows_[first_[cell + 1] - 1] + 1};
}

PosedHull::PosedHull(const HullIndex& index, const double* pose, const Vec3& origin)
    : index_(index), pose_(pose), origin_(origin) {
  const Vec3 t = pose ? Vec3{pose[3], pose[7], pose[11]} : Vec3{};
  // Fewer than 16 operations lead to a product; their values are below the sum of the magnitudes.
  rounding_ = 0x1p-48 * (2 * index.reach() + norm(t) + norm(origin));
}

Vec3 PosedHull::operator[](std::size_t i) const {
  const double* y = index_.vertices() + 3 * i;
  if (!pose_) return geometry::load(y) - origin_;
  Vec3 out;
  PosedBody::point(pose_, y, 1, out.data());
  return out - origin_;
}

Vec3 PosedHull::local(const Vec3& n) const {
  const double* p = pose_;
  if (!p) return n;
  return {p[0] * n[0] + p[4] * n[1] + p[8] * n[2], p[1] * n[0] + p[5] * n[1] + p[9] * n[2],
          p[2] * n[0] + p[6] * n[1] + p[10] * n[2]};
}

// The first of the vertices furthest along n, as PosedBody places them. Those that can be it are
// within four times the rounding error along the local direction.
std::size_t PosedHull::extreme(const Vec3& n) const {
  const Vec3 m = local(n);
  const HullIndex::List list = index_.near(m);
  std::size_t best = 0;
  double most = -INFINITY;
  const auto compare = [&](std::size_t i) {
    const double x = dot(n, (*this)[i]);
    if (most < x || (most == x && i < best)) most = x, best = i;
  };
  if (list.begin == nullptr || !(4 * rounding_ < 0.5 * index_.margin())) {
    for (std::size_t i = 0; i < index_.size(); ++i) compare(i);
    return best;
  }
  const auto height = [&](std::uint32_t i) {
    return dot(m, geometry::load(index_.vertices() + 3 * i));
  };
  double high = -INFINITY;
  double heights[64];
  const std::size_t count = static_cast<std::size_t>(list.end - list.begin);
  if (count > 64) {
    for (std::size_t k = 0; k < count; ++k) compare(list.begin[k]);
    return best;
  }
  for (std::size_t k = 0; k < count; ++k)
    heights[k] = height(list.begin[k]), high = std::max(high, heights[k]);
  const double slack = 4 * rounding_ * norm(n);
  for (std::size_t k = 0; k < count; ++k)
    if (heights[k] >= high - slack) compare(list.begin[k]);
  return best;
}

void PosedHull::near(const Vec3& n, double tolerance, Points<double>* out) const {
  const HullIndex::List list = index_.near(local(n));
  if (list.begin == nullptr || !(2 * (4 * rounding_ + tolerance) < index_.margin())) {
    for (std::size_t i = 0; i < index_.size(); ++i) out->push_back((*this)[i]);
    return;
  }
  for (const std::uint32_t* i = list.begin; i != list.end; ++i) out->push_back((*this)[*i]);
}

double PosedHull::least_size() const {
  return std::max(largest((*this)[0]), 0.25 * index_.spread());  // spread / sqrt(12), rounded
}
double PosedHull::most_size() const {
  return norm((*this)[0]) + index_.spread() * (1 + 0x1p-16) + 0x1p-40 * index_.reach();
}

}  // namespace tauguard::rigid
