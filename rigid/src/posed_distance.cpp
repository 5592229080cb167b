// Signed distance of bodies at poses without placing all vertices of a hull.
#include <algorithm>

#include "convex_contact.hpp"
#include "depth_bound.hpp"
#include "hull_descent.hpp"
#include "posed_body.hpp"
#include "signed_distance.hpp"

namespace tauguard::rigid {
namespace {

// The first three numbers of a body's row at its pose: a vertex or a centre.
Vec3 anchor(const PosedRow& side) {
  const double* p = side.bodies.row(side.row);
  if (!side.pose) return geometry::load(p);
  Vec3 out;
  PosedBody::point(side.pose, p, 1, out.data());
  return out;
}

// The vertices of a side without an index.
struct PlacedPoints {
  PosedBody body;
  Points<double> points;
  void set(const PosedRow& side, const Vec3& origin) {
    const bool moved = side.pose != nullptr;
    local_points(moved ? body.place(side.bodies, side.row, side.pose) : side.bodies, side.row,
                 origin, &points);
  }
};

double least_size(const PointList& points) { return size_of(points, points); }
double most_size(const PointList& points) { return size_of(points, points); }
double least_size(const PosedHull& hull) { return hull.least_size(); }
double most_size(const PosedHull& hull) { return hull.most_size(); }

void add_near(const PointList& points, const Vec3&, double, PointList* out) { *out = points; }
void add_near(const PosedHull& hull, const Vec3& n, double tolerance, PointList* out) {
  hull.near(n, tolerance, out);
}

// As PointDifferences, of which it differs in the first tetrahedron.
template <class A, class B>
class HullDifferences {
 public:
  using Source = Rows;
  HullDifferences(const A& a, const B& b, double size) : a_(a), b_(b), size_(size) {}

  Vec3 at(const Source& s) const { return b_[s[1]] - a_[s[0]]; }
  Source farthest(const Vec3& n) const { return {extreme(a_, -1.0 * n), extreme(b_, n)}; }
  bool span(std::array<Vec3, 4>* y, std::array<Source, 4>* from, Vec3* normal, bool*) const {
    return span_by_supports(*this, 1e-9 * size_, y, from, normal);
  }
  bool is_final(double excess, double, const Source& farthest) {
    return !(excess > 0) || !taken_.insert(farthest).second;
  }
  bool sees(double excess, double) const { return excess > 0; }
  bool unsure(double side, const Vec3& normal, double square,
              const std::array<const Vec3*, 3>& y) const {
    return side_is_rounding(side, normal, y, square, size_);
  }

 private:
  const A& a_;
  const B& b_;
  double size_;
  std::set<Source> taken_;
};

// The size is known between two bounds only: `low` for the certificates, `high` for the rounding.
template <class A, class B>
struct Query {
  const A& a;
  const B& b;
  double low, high;

  // As certified_apart.
  bool apart_for_certain(SignedDistance* out) const {
    const Nearest ends = nearest_of(a, b);
    *out = apart(ends.a, ends.b);
    if (!(out->distance > near * high)) return false;
    const Vec3 n = out->normal;
    return out->distance - (bottom(n) - top(n)) <= certain * low;
  }
  // As certified_depth.
  __attribute__((noinline)) bool together_for_certain(SignedDistance* out) const {
    using Polytope = ExpandingPolytope<double, HullDifferences<A, B>>;
    Polytope polytope(HullDifferences<A, B>(a, b, high));
    if (polytope.solve(2000) != Polytope::Answer::facet) return false;
    const Vec3 n = (-1 / norm(polytope.nearest.normal)) * polytope.nearest.normal;
    const double way = top(n) - bottom(n), depth = least_depth(polytope);
    if (!(depth > near * high && way - depth <= certain * low)) return false;
    geometry::Scratch<std::array<PointList, 2>> features;
    auto& [x, y] = *features;
    x.clear(), y.clear();
    add_near(a, n, 1e-11 * high, &x), add_near(b, -1.0 * n, 1e-11 * high, &y);
    *out = together(x, y, n, way, high);
    return true;
  }
  // Whether the tetrahedron of four differences certainly contains the origin: the four exact
  // determinants have the signs of the computed ones, whose error is below 2^-45 of the cube.
  __attribute__((noinline)) bool surrounded(const Nearest& ends) const {
    Vec3 w[4];
    for (int i = 0; i < 4; ++i) w[i] = b[ends.corner[i][1]] - a[ends.corner[i][0]];
    const double volumes[4] = {dot(w[1], cross(w[2], w[3])), -dot(w[0], cross(w[2], w[3])),
                               dot(w[0], cross(w[1], w[3])), -dot(w[0], cross(w[1], w[2]))};
    const double least = 0x1p-40 * high * high * high;
    const auto all = [&](double sign) {
      return std::all_of(volumes, volumes + 4, [&](double v) { return sign * v > least; });
    };
    return all(1) || all(-1);
  }
  double top(const Vec3& n) const { return dot(n, a[extreme(a, n)]); }
  double bottom(const Vec3& n) const { return dot(n, b[extreme(b, -1.0 * n)]); }
};

template <class A, class B>
Query<A, B> query_of(const A& a, const B& b) {
  return {a, b, std::max(least_size(a), least_size(b)), std::max(most_size(a), most_size(b))};
}

// The questions to a pair; `radii` is the sum of the radii.
struct Distances {
  SignedDistance* out;
  template <class A, class B>
  bool operator()(const A& a, const B& b, double radii) const {
    const Query<A, B> query = query_of(a, b);
    if (!(in_range(query.low) && in_range(query.high))) return false;
    if (!query.apart_for_certain(out) && !query.together_for_certain(out)) return false;
    return !(radii > 0) || std::fabs(out->distance - radii) > near * (query.high + radii);
  }
};
struct Meetings {
  bool* out;
  template <class A, class B>
  bool operator()(const A& a, const B& b, double radii) const {
    const Query<A, B> query = query_of(a, b);
    if (!(in_range(query.low) && in_range(query.high))) return false;
    const Nearest ends = nearest_of(a, b);
    const Vec3 way = ends.b - ends.a;
    const double slack = near * (query.high + radii), length = norm(way);
    *out = length < radii - slack || (ends.size == 4 && query.surrounded(ends));
    if (*out) return true;
    const Vec3 n = (1 / length) * way;
    return length > radii + slack && query.bottom(n) - query.top(n) > radii + slack;
  }
};

// The descent is compiled for each pair of lists and each question.
TAUGUARD_FLAT bool answer(const PosedHull& a, const PosedHull& b, double radii,
                          const Distances& question) {
  return question(a, b, radii);
}
TAUGUARD_FLAT bool answer(const PosedHull& a, const PointList& b, double radii,
                          const Distances& question) {
  return question(a, b, radii);
}
TAUGUARD_FLAT bool answer(const PointList& a, const PosedHull& b, double radii,
                          const Distances& question) {
  return question(a, b, radii);
}
TAUGUARD_FLAT bool answer(const PosedHull& a, const PosedHull& b, double radii,
                          const Meetings& question) {
  return question(a, b, radii);
}
TAUGUARD_FLAT bool answer(const PosedHull& a, const PointList& b, double radii,
                          const Meetings& question) {
  return question(a, b, radii);
}
TAUGUARD_FLAT bool answer(const PointList& a, const PosedHull& b, double radii,
                          const Meetings& question) {
  return question(a, b, radii);
}

template <class Question>
bool ask(const PosedRow& a, const PosedRow& b, double radii, const Vec3& origin,
         const Question& question) {
  const auto hull = [&](const PosedRow& side) { return PosedHull(*side.index, side.pose, origin); };
  if (a.index && b.index) return answer(hull(a), hull(b), radii, question);
  geometry::Scratch<PlacedPoints> placed;
  placed->set(a.index ? b : a, origin);
  if (a.index) return answer(hull(a), placed->points, radii, question);
  return answer(placed->points, hull(b), radii, question);
}

bool can_ask(const PosedRow& a, const PosedRow& b) {
  return (a.index || b.index) && is_polytope(a.bodies.kind) && is_polytope(b.bodies.kind);
}

}  // namespace

bool posed_distance(const PosedRow& a, const PosedRow& b, double radius_a, double radius_b,
                    SignedDistance* out) {
  if (!can_ask(a, b)) return false;
  const Vec3 origin = anchor(a);
  if (!ask(a, b, radius_a + radius_b, origin, Distances{out})) return false;
  *out = grown(*out, radius_a, radius_b, 0, false);
  out->point_a = out->point_a + origin, out->point_b = out->point_b + origin;
  return true;
}

std::optional<bool> posed_meet(const PosedRow& a, const PosedRow& b, double radius_a,
                               double radius_b) {
  bool out;
  if (!can_ask(a, b) || !ask(a, b, radius_a + radius_b, anchor(a), Meetings{&out})) return {};
  return out;
}

}  // namespace tauguard::rigid
