#include "mesh_rays.hpp"

#include <cstring>

#include "tauguard/geometry/feature_gap.hpp"
#include "tauguard/geometry/lanes.hpp"

namespace tauguard::rigid {
namespace {

using geometry::unit_roundoff;

typedef double Double8 __attribute__((vector_size(64)));
typedef float Single8 __attribute__((vector_size(32)));
typedef std::int64_t Long8 __attribute__((vector_size(64)));

TAUGUARD_INLINE Double8 widened(const float* x) {
  Single8 lanes;
  std::memcpy(&lanes, x, sizeof lanes);
  return __builtin_convertvector(lanes, Double8);
}
TAUGUARD_INLINE Double8 positive(const Double8& x) { return x > 0.0 ? x : Double8{}; }
TAUGUARD_INLINE Double8 magnitude(const Double8& x) { return x < 0.0 ? -x : x; }

// The squared distances of p, relative to the tree's centre, from the boxes of the children.
// Rounding is below 2^-48 of each; inf where there is no child.
TAUGUARD_CLONES void box_squares(const Node& node, const Vec3& p, double* out) {
  Double8 sum{};
  for (int k = 0; k < 3; ++k) {
    const Double8 d = positive(magnitude(p[k] - widened(node.centre[k])) * (1 - 0x1p-50) -
                               widened(node.extent[k]));
    sum += d * d;
  }
  std::memcpy(out, &sum, sizeof sum);
}

// Where the ray enters the boxes of the children, as multiples of the direction; inf where it
// misses them. `inverse`: 1 / direction by components. The pad covers rounding of the origin.
TAUGUARD_CLONES void box_entries(const Node& node, const Vec3& origin, const Vec3& inverse,
                                 double pad, double most, double* out) {
  Double8 near = Double8{}, far = Double8{} + most;
  for (int k = 0; k < 3; ++k) {
    const Double8 at = widened(node.centre[k]) - origin[k];
    const Double8 reach = widened(node.extent[k]) + (pad + 0x1p-50 * magnitude(at));
    const double size = std::fabs(inverse[k]);
    const Double8 middle = at * inverse[k], enter = middle - reach * size,
                  leave = middle + reach * size;
    near = enter > near ? enter : near;
    far = leave < far ? leave : far;
  }
  const Double8 lanes = near <= far ? near : Double8{} + INFINITY;
  std::memcpy(out, &lanes, sizeof lanes);
}

// With e, the sine between two sides, the perpendicular foot has an error of 8 u / e of their
// length: below 2^-46 of it for e > 2^-4. Thinner triangles need repeated steps.
Vec3 nearest_of_triangle(const Triangle& t, const Vec3& p) {
  const Vec3 a = geometry::load(t.v[0]);
  const auto gap = geometry::point_triangle(p, a, geometry::load(t.v[1]), geometry::load(t.v[2]));
  if (!(gap.nn > 0x1p-8)) {
    const auto at = gap.shortest(0);
    return a + at.u * gap.q + at.v * gap.r;
  }
  auto at = gap.perpendicular(gap.p);
  if (!(at.u >= 0 && at.v >= 0 && at.u + at.v <= 1)) at = gap.on_border();
  return a + at.u * gap.q + at.v * gap.r;
}

// Calls leaf(i) for the triangles of leaves that `lanes` lets pass, in order of its values.
// lanes(node, out) writes a key per child, inf to skip it; `key > limit` is skipped later too.
template <class Lanes, class Leaf>
void each_leaf(const Tree& tree, const double& limit, Lanes lanes, Leaf leaf) {
  struct Open {
    double key;
    Child child;
  };
  std::vector<Open> stack = {{0, 0}};
  alignas(64) double key[width];
  while (!stack.empty()) {
    const Open open = stack.back();
    stack.pop_back();
    if (open.key > limit) continue;
    if (is_leaf(open.child)) {
      for (int i = leaf_first(open.child); i < leaf_first(open.child) + leaf_count(open.child); ++i)
        leaf(i);
      continue;
    }
    const Node& node = tree.nodes[open.child];
    lanes(node, key);
    Open next[width];
    int n = 0;
    for (int s = 0; s < width; ++s)
      if (key[s] < INFINITY && key[s] <= limit) {
        int at = n++;
        for (; at > 0 && next[at - 1].key < key[s]; --at) next[at] = next[at - 1];
        next[at] = {key[s], node.child[s]};
      }
    stack.insert(stack.end(), next, next + n);
  }
}

Vec3 centre_of(const Tree& tree) { return geometry::load(tree.centre); }

// Sign of det[d, a - o, b - o]. The filter's bound is that of orient3d, with two of the three
// differences in place of three.
int turn_about(const Vec3& d, const Vec3& o, const double* a, const double* b, double* det) {
  const Vec3 u = geometry::load(a) - o, v = geometry::load(b) - o;
  const double yz = u.y * v.z, zy = u.z * v.y, zx = u.z * v.x, xz = u.x * v.z, xy = u.x * v.y,
               yx = u.y * v.x;
  *det = (yz - zy) * d.x + (zx - xz) * d.y + (xy - yx) * d.z;
  const double permanent = (std::fabs(yz) + std::fabs(zy)) * std::fabs(d.x) +
                           (std::fabs(zx) + std::fabs(xz)) * std::fabs(d.y) +
                           (std::fabs(xy) + std::fabs(yx)) * std::fabs(d.z);
  if (permanent > 1e-250 && permanent < 1e300 && std::fabs(*det) > 16 * unit_roundoff * permanent)
    return geometry::sign_of(*det);
  using geometry::Dyadic;
  Dyadic x[3], y[3], z[3];
  for (int k = 0; k < 3; ++k) {
    x[k] = Dyadic(a[k]) - Dyadic(o[k]);
    y[k] = Dyadic(b[k]) - Dyadic(o[k]);
    z[k] = Dyadic(d[k]);
  }
  return ((x[1] * y[2] - x[2] * y[1]) * z[0] + (x[2] * y[0] - x[0] * y[2]) * z[1] +
          (x[0] * y[1] - x[1] * y[0]) * z[2])
      .sign();
}

// Where the ray meets the triangle, as a multiple of `d`; inf if it misses it.
double entry(const Triangle& t, const Vec3& o, const Vec3& d) {
  double det[3];
  int low = 0, high = 0;
  for (int i = 0; i < 3; ++i) {
    const int s = turn_about(d, o, t.v[(i + 1) % 3], t.v[(i + 2) % 3], &det[i]);
    low = std::min(low, s), high = std::max(high, s);
    if (s == 0) det[i] = 0;
    if (low * high < 0) return INFINITY;
  }
  const int along = low + high;  // the sign of normal . d
  if (along == 0 || geometry::orient3d(t.v[0], t.v[1], t.v[2], o.data()) * along > 0)
    return INFINITY;
  // The point is a mean of the corners, so that it is in the triangle however flat the ray is.
  const double sum = det[0] + det[1] + det[2];
  Vec3 at{};
  for (int i = 0; i < 3; ++i)
    at = at +
         (sum * along > 0 ? std::max(det[i] / sum, 0.0) : 1.0 / 3) * (geometry::load(t.v[i]) - o);
  return std::max(0.0, dot(at, d) / dot(d, d));
}

// The sign of a -> b -> p in the plane of x and y, where p is moved by (e, e^2) for a tiny e > 0,
// so that no point is on a line.
int moved_turn(const double* a, const double* b, const Vec3& p) {
  if (const int s = geometry::orient2d(a, b, p.data())) return s;
  if (a[1] != b[1]) return a[1] < b[1] ? -1 : 1;
  return a[0] == b[0] ? 0 : a[0] < b[0] ? 1 : -1;
}

}  // namespace

NearestPoint nearest_point(const Mesh& mesh, const Vec3& p) {
  const geometry::RoundToNearest guard;
  const Vec3 local = p - centre_of(mesh.tree);
  double best = INFINITY, limit = INFINITY;
  NearestPoint out{INFINITY, {}, -1};
  each_leaf(
      mesh.tree, limit, [&](const Node& node, double* key) { box_squares(node, local, key); },
      [&](int i) {
        const Vec3 at = nearest_of_triangle(mesh.tree.triangles[i], p);
        const double square = dot(at - p, at - p);
        const std::int32_t face = mesh.tree.id[i];
        if (square > best || (square == best && face > out.face)) return;
        best = square, limit = square * (1 + 0x1p-44);
        out.point = at, out.face = face;
      });
  out.distance = norm(out.point - p);
  return out;
}

bool on_surface(const Mesh& mesh, const Vec3& p) {
  const geometry::RoundToNearest guard;
  const Vec3 local = p - centre_of(mesh.tree);
  double limit = 0;
  bool met = false;
  each_leaf(
      mesh.tree, limit, [&](const Node& node, double* key) { box_squares(node, local, key); },
      [&](int i) {
        met = met || exact::segment_meets(p.data(), p.data(), mesh.tree.triangles[i]);
        if (met) limit = -1;
      });
  return met;
}

// The triangles above p are counted, with the sign of their normals. Where p is below an edge or a
// corner, moving p (moved_turn) leaves it below exactly the triangles of one side.
int winding(const Mesh& mesh, const Vec3& p) {
  const geometry::RoundToNearest guard;
  const Vec3 local = p - centre_of(mesh.tree);
  int turns = 0;
  double limit = INFINITY;
  each_leaf(
      mesh.tree, limit,
      [&](const Node& node, double* key) {
        for (int s = 0; s < width; ++s) {
          double aside = 0;
          for (int k = 0; k < 2; ++k)
            aside = std::max(aside, std::fabs(local[k] - node.centre[k][s]) * (1 - 0x1p-50) -
                                        double(node.extent[k][s]));
          const double below = double(node.centre[2][s]) + node.extent[2][s] - local.z;
          key[s] = aside > 0 || below < -0x1p-50 * std::fabs(local.z) ? INFINITY : 0;
        }
      },
      [&](int i) {
        const Triangle& t = mesh.tree.triangles[i];
        const int side = moved_turn(t.v[0], t.v[1], p);
        if (side == 0 || moved_turn(t.v[1], t.v[2], p) != side ||
            moved_turn(t.v[2], t.v[0], p) != side)
          return;
        if (geometry::orient3d(t.v[0], t.v[1], t.v[2], p.data()) * side < 0) turns += side;
      });
  return turns;
}

RayHit cast_ray(const Mesh& mesh, const Vec3& origin, const Vec3& direction) {
  const geometry::RoundToNearest guard;
  const Vec3 d = geometry::unit_scale(largest(direction)) * direction;
  const Vec3 local = origin - centre_of(mesh.tree);
  Vec3 inverse;
  for (int k = 0; k < 3; ++k)
    inverse[k] = std::copysign(std::min(1 / std::fabs(d[k]), 0x1p500), d[k]);
  const double pad = 0x1p-48 * (largest(local) + mesh.tree.radius);
  double limit = INFINITY, best = INFINITY;
  RayHit out{INFINITY, -1};
  each_leaf(
      mesh.tree, limit,
      [&](const Node& node, double* key) { box_entries(node, local, inverse, pad, limit, key); },
      [&](int i) {
        const double t = entry(mesh.tree.triangles[i], origin, d);
        const std::int32_t face = mesh.tree.id[i];
        if (t == INFINITY || t > best || (t == best && face > out.face)) return;
        best = t, limit = t * (1 + 0x1p-40) + pad, out.face = face;
      });
  out.distance = best * norm(d);
  return out;
}

}  // namespace tauguard::rigid
