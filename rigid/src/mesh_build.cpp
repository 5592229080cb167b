// Builds a Tree. To get a node's eight children, the range with the most triangles is split
// repeatedly. A split uses the best of 15 planes perpendicular to the longest axis of the
// triangles' centres, by the surface-area heuristic.
#include <algorithm>
#include <cstring>

#include "mesh_tree.hpp"
#include "tauguard/geometry/interrupt.hpp"

namespace tauguard::rigid {
namespace {

constexpr int most_bins = 16;

typedef float Four __attribute__((vector_size(16)));

Four four(const float* x) {
  Four v;
  std::memcpy(&v, x, sizeof v);
  return v;
}

// Three coordinates and one unused lane.
struct FloatBox {
  Four lo = (Four){} + INFINITY, hi = (Four){} - INFINITY;
  void add(Four l, Four h) {
    lo = l < lo ? l : lo;
    hi = h > hi ? h : hi;
  }
  void add(const FloatBox& o) { add(o.lo, o.hi); }
  float area() const {
    const float x = hi[0] - lo[0], y = hi[1] - lo[1], z = hi[2] - lo[2];
    return x * y + y * z + z * x;
  }
};

float round_down(double x) { return std::nextafter(static_cast<float>(x), -INFINITY); }
float round_up(double x) { return std::nextafter(static_cast<float>(x), INFINITY); }

}  // namespace

Tree::Tree(const double* vertices, const std::int32_t* faces, std::size_t n_faces) {
  geometry::Aabb all;
  for (std::size_t i = 0; i < 3 * n_faces; ++i) all.add(vertices + 3 * faces[i]);
  magnitude = radius = 0;
  for (int k = 0; k < 3; ++k) {
    centre[k] = 0.5 * all.lo[k] + 0.5 * all.hi[k];
    magnitude = std::max({magnitude, std::fabs(all.lo[k]), std::fabs(all.hi[k])});
  }
  items_.resize(n_faces);
  double square = 0;
  for (std::size_t i = 0; i < n_faces; ++i) {
    Item& item = items_[i];
    item.row = static_cast<std::int32_t>(i);
    double lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
      const double a = vertices[3 * faces[3 * i] + k], b = vertices[3 * faces[3 * i + 1] + k],
                   c = vertices[3 * faces[3 * i + 2] + k];
      lo[k] = std::min({a, b, c}) - centre[k];
      hi[k] = std::max({a, b, c}) - centre[k];
      item.lo[k] = round_down(lo[k]);
      item.hi[k] = round_up(hi[k]);
    }
    double s = 0;
    for (int k = 0; k < 3; ++k) s += std::max(lo[k] * lo[k], hi[k] * hi[k]);
    square = std::max(square, s);
  }
  radius = std::sqrt(square) * (1 + 1e-14);
  double lo[3], hi[3];
  for (int k = 0; k < 3; ++k)
    lo[k] = round_down(all.lo[k] - centre[k]), hi[k] = round_up(all.hi[k] - centre[k]);
  root = outward(lo, hi);

  nodes.reserve(n_faces / 2 + 1);
  build({0, static_cast<std::int32_t>(n_faces)});
  triangles.resize(n_faces);
  id.resize(n_faces);
  for (std::size_t i = 0; i < n_faces; ++i) {
    id[i] = items_[i].row;
    for (int c = 0; c < 3; ++c)
      for (int k = 0; k < 3; ++k) triangles[i].v[c][k] = vertices[3 * faces[3 * id[i] + c] + k];
  }
  std::vector<Item>().swap(items_);
}

std::int32_t Tree::build(Range all) {
  const auto index = static_cast<std::int32_t>(nodes.size());
  nodes.emplace_back();
  Range part[width] = {all};
  int parts = 1;
  while (parts < width) {
    int widest = 0;
    for (int i = 1; i < parts; ++i)
      if (part[i].count() > part[widest].count()) widest = i;
    if (part[widest].count() <= small_leaf) break;
    const std::int32_t middle = split(part[widest]);
    part[parts++] = {middle, part[widest].end};
    part[widest].end = middle;
  }
  for (int slot = 0; slot < width; ++slot) {
    Node& node = nodes[index];
    if (slot >= parts) {
      for (int k = 0; k < 3; ++k) node.centre[k][slot] = 0, node.extent[k][slot] = -INFINITY;
      node.child[slot] = no_child;
      continue;
    }
    const Range r = part[slot];
    FloatBox box;
    for (auto i = r.begin; i < r.end; ++i) box.add(four(items_[i].lo), four(items_[i].hi));
    const double lo[3] = {box.lo[0], box.lo[1], box.lo[2]},
                 hi[3] = {box.hi[0], box.hi[1], box.hi[2]};
    const Box b = outward(lo, hi);
    for (int k = 0; k < 3; ++k)
      node.centre[k][slot] = b.centre[k], node.extent[k][slot] = b.extent[k];
    if (r.count() <= leaf_size)
      node.child[slot] = ~(r.begin * 8 + r.count());
    else {
      const std::int32_t child = build(r);
      nodes[index].child[slot] = child;  // `nodes` may have moved
    }
  }
  return index;
}

// Reorders items [begin, end) by the side of a plane that they are on. Returns the first item of
// the second side; neither side is empty.
std::int32_t Tree::split(Range r) {
  geometry::poll_interrupt();
  FloatBox middles;
  for (auto i = r.begin; i < r.end; ++i) {
    const Four m = four(items_[i].lo) + four(items_[i].hi);
    middles.add(m, m);
  }
  const Four lo = middles.lo, hi = middles.hi;
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (hi[k] - lo[k] > hi[axis] - lo[axis]) axis = k;
  const auto half = r.begin + r.count() / 2;
  const auto first = items_.begin();
  const auto less = [axis](const Item& a, const Item& b) {
    return a.middle(axis) < b.middle(axis);
  };
  const int bins = r.count() < 4 * most_bins ? most_bins / 2 : most_bins;
  const float scale = static_cast<float>(bins) * 0.9999f / (hi[axis] - lo[axis]), origin = lo[axis];
  if (!std::isfinite(scale) || r.count() <= 4) {  // all centres (nearly) equal, or few items
    std::nth_element(first + r.begin, first + half, first + r.end, less);
    return half;
  }
  const auto bin_of = [=](const Item& item) {
    return std::min(bins - 1, static_cast<int>((item.middle(axis) - origin) * scale));
  };
  FloatBox box[most_bins];
  int count[most_bins] = {};
  for (auto i = r.begin; i < r.end; ++i) {
    const int b = bin_of(items_[i]);
    ++count[b];
    box[b].add(four(items_[i].lo), four(items_[i].hi));
  }
  float right_cost[most_bins];
  FloatBox side;
  int n = 0;
  for (int b = bins - 1; b > 0; --b) {
    side.add(box[b]);
    n += count[b];
    right_cost[b] = n ? side.area() * static_cast<float>(n) : 0;
  }
  side = FloatBox();
  n = 0;
  int best = -1;
  float best_cost = INFINITY;
  for (int b = 1; b < bins; ++b) {
    side.add(box[b - 1]);
    n += count[b - 1];
    if (n == 0 || n == r.count()) continue;
    const float cost = side.area() * static_cast<float>(n) + right_cost[b];
    if (cost < best_cost) best_cost = cost, best = b;
  }
  if (best < 0) {
    std::nth_element(first + r.begin, first + half, first + r.end, less);
    return half;
  }
  const auto middle = std::partition(first + r.begin, first + r.end,
                                     [=](const Item& i) { return bin_of(i) < best; });
  return static_cast<std::int32_t>(middle - first);
}

}  // namespace tauguard::rigid
