// The expanding polytope algorithm (van den Bergen 2001) on a - b: a point q of its boundary
// nearest to the origin is the shortest translation of b that separates the cores. The polytope
// need not hold the origin yet: its faces expand in the order of their signed distance, those with
// the origin outside first.
#include "tauguard/rigid/distance.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace tauguard::rigid {
namespace {

constexpr int most_vertices = 200;
// Depths are exact for polytopes; curved cores stop at this share of their size.
constexpr double resolution = 1e-7;

struct Vertex {
  Vec q, a, b;  // q = a - b
};

struct Face {
  std::array<int, 3> v;
  Vec n;
  double offset;
};

class Polytope {
 public:
  Polytope(const SupportShape& a, const SupportShape& b)
      : a_(a), b_(b), size_(a.reach() + b.reach()) {}

  Vertex along(const Vec& d) const {
    Vertex p;
    p.a = a_.support(d), p.b = b_.support(-1.0 * d);
    p.q = p.a - p.b;
    return p;
  }

  // A tetrahedron of support points; false where a - b is flat to rounding, with its normal in
  // `flat`.
  bool start(Vec* flat) {
    const double small = 1e-9 * size_;
    const Vec x = {1, 0, 0};
    vertices_ = {along(x), along(-1.0 * x)};
    for (int axis = 1; axis < 3 && !(norm(edge(1)) > small); ++axis) {
      Vec d{};
      d[axis] = 1;
      vertices_ = {along(d), along(-1.0 * d)};
    }
    const Vec e = edge(1);
    Vec side{};
    side[std::fabs(e[0]) < std::fabs(e[1]) ? (std::fabs(e[0]) < std::fabs(e[2]) ? 0 : 2)
                                           : (std::fabs(e[1]) < std::fabs(e[2]) ? 1 : 2)] = 1;
    const Vec u = cross(e, side), w = cross(e, u);
    *flat = u;
    if (!add_off(u, [&](const Vec& y) { return norm(cross(e, y)) > small * norm(e); }) &&
        !add_off(w, [&](const Vec& y) { return norm(cross(e, y)) > small * norm(e); }))
      return false;
    const Vec n = cross(e, edge(2));
    *flat = n;
    if (!add_off(n, [&](const Vec& y) { return std::fabs(dot(n, y)) > small * norm(n); }))
      return false;
    inside_ = 0.25 * (vertices_[0].q + vertices_[1].q + vertices_[2].q + vertices_[3].q);
    for (const auto& v :
         {std::array{0, 1, 2}, std::array{0, 1, 3}, std::array{0, 2, 3}, std::array{1, 2, 3}})
      add_face(v[0], v[1], v[2]);
    return true;
  }

  const Face& nearest() const {
    return *std::min_element(faces_.begin(), faces_.end(),
                             [](const Face& p, const Face& q) { return p.offset < q.offset; });
  }

  // True where the face was not final: the polytope grew.
  bool expand(const Face& face) {
    const Vertex p = along(face.n);
    if (dot(face.n, p.q) - face.offset <= resolution * size_ ||
        static_cast<int>(vertices_.size()) >= most_vertices)
      return false;
    const int fresh = static_cast<int>(vertices_.size());
    std::vector<std::pair<int, int>> horizon;
    std::vector<Face> kept;
    for (const Face& f : faces_) {
      if (dot(f.n, p.q) - f.offset <= 1e-14 * size_) {
        kept.push_back(f);
        continue;
      }
      for (int k = 0; k < 3; ++k) {
        const std::pair<int, int> e = std::minmax(f.v[k], f.v[(k + 1) % 3]);
        const auto twin = std::find(horizon.begin(), horizon.end(), e);
        twin == horizon.end() ? horizon.push_back(e) : static_cast<void>(horizon.erase(twin));
      }
    }
    if (horizon.empty() || kept.size() == faces_.size()) return false;
    vertices_.push_back(p);
    faces_ = std::move(kept);
    for (const auto& [i, j] : horizon) add_face(i, j, fresh);
    return true;
  }

  // The point of the face nearest to the origin, as one point on each core.
  void points(const Face& f, Vec* on_a, Vec* on_b) const {
    const Vertex &p = vertices_[f.v[0]], &q = vertices_[f.v[1]], &r = vertices_[f.v[2]];
    const Vec e = q.q - p.q, g = r.q - p.q, n = cross(e, g), o = f.offset * f.n - p.q;
    const double nn = dot(n, n);
    double s = nn > 0 ? dot(cross(o, g), n) / nn : 0, t = nn > 0 ? dot(cross(e, o), n) / nn : 0;
    s = std::clamp(s, 0.0, 1.0), t = std::clamp(t, 0.0, 1.0 - s);
    *on_a = (1 - s - t) * p.a + s * q.a + t * r.a;
    *on_b = (1 - s - t) * p.b + s * q.b + t * r.b;
  }

 private:
  Vec edge(int i) const { return vertices_[i].q - vertices_[0].q; }

  template <class Test>
  bool add_off(const Vec& d, Test&& off) {
    for (const double sign : {1.0, -1.0}) {
      const Vertex p = along(sign * d);
      if (off(p.q - vertices_[0].q)) return vertices_.push_back(p), true;
    }
    return false;
  }

  void add_face(int i, int j, int k) {
    const Vec &p = vertices_[i].q, &q = vertices_[j].q, &r = vertices_[k].q;
    Vec n = cross(q - p, r - p);
    const double length = norm(n);
    if (!(length > 0)) return;
    n = (1 / length) * n;
    if (dot(n, p - inside_) < 0) n = -1.0 * n;
    faces_.push_back({{i, j, k}, n, dot(n, p)});
  }

  const SupportShape &a_, &b_;
  double size_;
  Vec inside_{};
  std::vector<Vertex> vertices_;
  std::vector<Face> faces_;
};

}  // namespace

void penetration(const SupportShape& a, const SupportShape& b, Distance* d) {
  Polytope polytope(a, b);
  Vec flat{};
  if (!polytope.start(&flat)) {
    const double length = norm(flat);
    d->n = length > 0 ? (1 / length) * flat : Vec{0, 0, 1};
    if (dot(d->n, b.middle() - a.middle()) < 0) d->n = -1.0 * d->n;
    d->lower = 0;
    return;
  }
  Face face = polytope.nearest();
  while (polytope.expand(face)) face = polytope.nearest();
  // b moved by offset * n leaves a: seen from a, b lies on the other side.
  d->n = face.n;
  d->lower = -std::max(0.0, face.offset);
  Vec on_a, on_b;
  polytope.points(face, &on_a, &on_b);
  d->on_a = d->on_b = 0.5 * (on_a + on_b);
}

}  // namespace tauguard::rigid
