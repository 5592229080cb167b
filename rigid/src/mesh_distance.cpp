// Branch and bound over pairs of boxes, the nearest first (a heap). Boxes further apart than the
// nearest triangles so far are left out: by the separating axes of the overlap test, whose pad
// grows by this distance, and by the direction between the nearest points so far, which prunes most
// pairs.
#include "mesh_distance.hpp"

#include "mesh_swept.hpp"
#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/lanes.hpp"
#include "triangle_distance.hpp"

namespace tauguard::rigid {
namespace {

using geometry::load;

using geometry::abs;
using geometry::Float8;

// Lower bounds of the distances of the children of `node` from a box in the node's frame: the
// largest gap along the axes of both boxes and along the line of their centres. inf where there is
// no child. Rounding is not subtracted.
TAUGUARD_CLONES void lower_bounds(const ObbNode& node, const FloatObb& box, float* out) {
  const Float8* centre = reinterpret_cast<const Float8*>(node.centre);
  const Float8* e = reinterpret_cast<const Float8*>(node.extent);
  const Float8 d0 = box.centre[0] - centre[0], d1 = box.centre[1] - centre[1],
               d2 = box.centre[2] - centre[2];
  const Float8 square = d0 * d0 + d1 * d1 + d2 * d2;
  Float8 d[3], s[3][3], most = (Float8){}, both = (Float8){}, across[3] = {};
  for (int i = 0; i < 3; ++i) {
    const Float8* n = reinterpret_cast<const Float8*>(node.axis[i]);
    d[i] = (n[0] * d0 + n[1] * d1) + n[2] * d2;
    Float8 reach = e[i];
    for (int j = 0; j < 3; ++j) {
      const Float8 r = (n[0] * box.axis[j][0] + n[1] * box.axis[j][1]) + n[2] * box.axis[j][2];
      s[i][j] = abs(r);
      across[j] += d[i] * r;
      reach += s[i][j] * box.extent[j];
    }
    const Float8 gap = abs(d[i]) - reach;
    most = gap > most ? gap : most;
    both += e[i] * abs(d[i]);
  }
  for (int j = 0; j < 3; ++j) {
    const Float8 gap =
        abs(across[j]) - (((e[0] * s[0][j] + e[1] * s[1][j]) + e[2] * s[2][j]) + box.extent[j]);
    most = gap > most ? gap : most;
    both += box.extent[j] * abs(across[j]);
  }
  // (|d|^2 - both) / |d|; not where the squares may underflow.
  const Float8 excess = square - both;
  Float8 length;
  for (int k = 0; k < width; ++k) length[k] = std::sqrt(square[k]);
  const Float8 gap = square > 1e-30f ? excess / length : (Float8){};
  most = gap > most ? gap : most;
  most = e[0] < 0.0f ? (Float8){} + INFINITY : most;
  std::memcpy(out, &most, sizeof most);
}

class Search {
 public:
  Search(const Mesh& a, const Mesh& b, const Pose& pose)
      : a_(a), b_(b), pose_(pose), at_(a.tree, b.tree, pose), pad_(at_.b_in_a.pad) {}

  void run() {
    std::vector<Open> stack = {{{{-1, 0}, {-1, 0}}, 0}};
    ObbNode scratch;
    float key[width];
    while (!stack.empty()) {
      geometry::poll_interrupt();
      std::pop_heap(stack.begin(), stack.end(), further);
      const Open top = stack.back();
      stack.pop_back();
      if (top.lower > limit_) return;
      const SlotPair& pair = top.pair;
      const Child ca = pair.a.child(a_.tree), cb = pair.b.child(b_.tree);
      if (is_leaf(ca) && is_leaf(cb)) {
        leaves(ca, cb);
        continue;
      }
      const FloatObb x = oriented_box(a_, pair.a), y = oriented_box(b_, pair.b);
      const bool open_a = is_leaf(cb) || (!is_leaf(ca) && x.size() >= y.size());
      if (open_a)
        lower_bounds(oriented(a_, ca, scratch), placed(y, at_.b_in_a), key);
      else
        lower_bounds(oriented(b_, cb, scratch), placed(x, at_.a_in_b), key);
      for (int s = 0; s < width; ++s) {
        if (!(key[s] <= limit_)) continue;
        stack.push_back({open_a ? SlotPair{{ca, s}, pair.b} : SlotPair{pair.a, {cb, s}}, key[s]});
        std::push_heap(stack.begin(), stack.end(), further);
      }
    }
  }

  NearestPair best;  // relative to the centre of a
  int leaf_a = -1, leaf_b = -1;

 private:
  struct Open {
    SlotPair pair;
    float lower;  // bound of the distance
  };
  static bool further(const Open& x, const Open& y) { return x.lower > y.lower; }

  void leaves(Child ca, Child cb) {
    const Vec3 origin = load(a_.tree.centre);
    Vec3 x[leaf_size][3];
    const int first_a = leaf_first(ca), count_a = leaf_count(ca);
    for (int i = 0; i < count_a; ++i)
      for (int c = 0; c < 3; ++c) x[i][c] = load(a_.tree.triangles[first_a + i].v[c]) - origin;
    for (int j = leaf_first(cb); j < leaf_first(cb) + leaf_count(cb); ++j) {
      const Triangle moved = pose_.apply(b_.tree.triangles[j]);
      const Vec3 y[3] = {load(moved.v[0]) - origin, load(moved.v[1]) - origin,
                         load(moved.v[2]) - origin};
      for (int i = 0; i < count_a; ++i) pair(x[i], y, first_a + i, j);
    }
  }

  void pair(const Vec3* x, const Vec3* y, int i, int j) {
    if (leaf_a >= 0) {
      const auto range = [&](const Vec3* t) {
        const double p = dot(way_, t[0]), q = dot(way_, t[1]), r = dot(way_, t[2]);
        return std::array{std::min({p, q, r}), std::max({p, q, r})};
      };
      const auto p = range(x), q = range(y);
      if (std::max(q[0] - p[1], p[0] - q[1]) > length_) return;
    }
    const double before = best.square;
    take_triangles(x, y, best);
    if (!(best.square < before)) return;
    leaf_a = i, leaf_b = j;
    // Slack for rounding: a projection has an error of below 2^-48 of the trees' radii.
    length_ = std::sqrt(best.square);
    const Vec3 gap = best.b - best.a;
    way_ = length_ > 0 ? (1 / length_) * gap : Vec3{1, 0, 0};
    length_ += 0x1p-46 * (a_.tree.radius + b_.tree.radius);
    limit_ = std::nextafter(static_cast<float>(pad_ + length_) * (1 + 0x1p-20f), INFINITY);
  }

  const Mesh &a_, &b_;
  const Pose& pose_;
  Placement at_;
  const float pad_;
  double length_ = INFINITY;
  float limit_ = std::numeric_limits<float>::max();
  Vec3 way_{};
};

}  // namespace

MeshGap mesh_distance(const Mesh& a, const Mesh& b, const Pose& pose, Scratch& scratch) {
  const geometry::RoundToNearest guard;
  Contact contact;
  if (first_contact(a, b, pose, scratch, &contact)) {
    const Vec3 point = load(contact.point);
    return {0, point, point, load(contact.normal), {contact.a, contact.b}};
  }
  Search search(a, b, pose);
  search.run();
  const Vec3 origin = load(a.tree.centre), gap = search.best.b - search.best.a;
  const double distance = norm(gap);
  const Vec3 normal = distance > 0 ? (1 / distance) * gap : Vec3{0, 0, 1};
  return {std::max(distance, std::numeric_limits<double>::denorm_min()),
          origin + search.best.a,
          origin + search.best.b,
          normal,
          {a.tree.id[search.leaf_a], b.tree.id[search.leaf_b]}};
}

}  // namespace tauguard::rigid
