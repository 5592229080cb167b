#include "sweep.hpp"

#include <algorithm>

#include "tauguard/rigid/first_contact.hpp"

namespace tauguard::contacts {
namespace {

Aabb box_at(const SupportShape& m) {
  Aabb box;
  for (int k = 0; k < 3; ++k) {
    Vec3 d{};
    d[k] = 1;
    box.hi[k] = m.support(d)[k] + m.radius();
    d[k] = -1;
    box.lo[k] = m.support(d)[k] - m.radius();
  }
  return box;
}

Aabb widened(Aabb box, double by) {
  box.widen(by);
  return box;
}

rigid::MovingBody vertices_of(const Shape& s, const LocalFrame& in_body, const RigidMotion& motion,
                              const Vec3& origin) {
  rigid::MovingBody body(motion, origin);
  if (s.kind == Kind::hulls)
    for (std::size_t i = 0; i < s.x.size(); ++i)
      body.add_vertex(in_body.out({s.x[i], s.y[i], s.z[i]}));
  else
    for (int corner = 0; corner < 8; ++corner)
      body.add_vertex(
          in_body.out({corner & 1 ? s.size[0] : -s.size[0], corner & 2 ? s.size[1] : -s.size[1],
                       corner & 4 ? s.size[2] : -s.size[2]}));
  for (const Vec3& n : s.normals) body.add_normal(in_body.turn(n));
  for (const Vec3& e : s.edges) body.add_edge(in_body.turn(e));
  body.complete = !s.normals.empty();
  return body;
}

}  // namespace

// The box of both ends contains the chord of every point's path. The distance of the path from its
// chord is at most reach (1 - cos(angle / 2)). The last term of `bulge` covers rounding.
Aabb swept(SupportShape m, const RigidMotion& motion) {
  if (m.half_space()) return {{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
  m.move_to(0);
  Aabb box = box_at(m);
  m.move_to(1);
  box.add(box_at(m));
  const double sine = std::sin(0.25 * std::min(motion.speed, 2 * M_PI));
  const double bulge = 2 * m.reach() * sine * sine + 64 * unit_roundoff * m.magnitude();
  box.widen(bulge);
  return box;
}

void Geoms::add(Shape shape, int body, const LocalFrame& in_body) {
  shapes_.push_back(std::move(shape));
  in_body_.push_back(in_body);
  body_.push_back(body);
  if (std::find(bodies_.begin(), bodies_.end(), body) == bodies_.end()) bodies_.push_back(body);
  const std::size_t n = static_cast<std::size_t>(body) + 1;
  if (n > seen_.size()) {
    const double none[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    seen_.resize(n, 0), still_.resize(n, 0), same_.resize(n, 0), last_.resize(24 * n, 0);
    motions_.resize(n, RigidMotion(none, none + 1, none + 1));
  }
  boxes_.resize(shapes_.size());
}

SupportShape Geoms::mover(int geom, const Vec3& origin) const {
  return SupportShape(shapes_[geom], in_body_[geom], motions_[body_[geom]], origin);
}

void Geoms::update(const Poses& p) {
  moved_ = 0;
  for (const int b : bodies_) {
    double now[24];
    std::copy_n(p.xpos_t0 + 3 * b, 3, now), std::copy_n(p.xmat_t0 + 9 * b, 9, now + 3);
    std::copy_n(p.xpos_t1 + 3 * b, 3, now + 12), std::copy_n(p.xmat_t1 + 9 * b, 9, now + 15);
    const bool unchanged = seen_[b] && std::equal(now, now + 24, last_.begin() + 24 * b);
    still_[b] = std::equal(now, now + 12, now + 12);
    same_[b] = unchanged && still_[b];
    if (unchanged) continue;
    std::copy_n(now, 24, last_.begin() + 24 * b);
    seen_[b] = 1;
    motions_[b] = motion_between(now, now + 3, now + 12, now + 15);
    ++moved_;
  }
  for (std::size_t g = 0; g < shapes_.size(); ++g)
    if (!same_[body_[g]]) boxes_[g] = swept(mover(static_cast<int>(g), Vec3{}), motions_[body_[g]]);
}

namespace {

// First contact of two polytopes without threshold, by the kernel of rigid/ for vertex lists.
Touch polytopes_touch(const Geoms& geoms, const GeomPair& pair, const Vec3& origin, SupportShape& a,
                      SupportShape& b) {
  auto x = vertices_of(geoms.shape(pair.a), geoms.in_body(pair.a), geoms.motion(pair.a), origin);
  auto y = vertices_of(geoms.shape(pair.b), geoms.in_body(pair.b), geoms.motion(pair.b), origin);
  const rigid::Impact impact = rigid::first_contact(x, y, 0, 1);
  if (!impact.hit) return {};
  a.move_to(impact.t), b.move_to(impact.t);
  return describe(a, b, distance_of(a, b, impact.normal, 0), impact.t > 0 ? impact.normal : Vec3{},
                  impact.t);
}

}  // namespace

Counts RigidPairs::find(Geoms& geoms, const Poses& poses, std::vector<Row>* rows) {
  geoms.update(poses);
  Counts counts;
  counts.moved = geoms.moved();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    const GeomPair& pair = pairs_[i];
    Cached& cached = cache_[i];
    if (cached.known && geoms.as_before(pair.a) && geoms.as_before(pair.b)) {
      ++counts.reused;
      if (cached.hit) rows->push_back(cached.row);
      continue;
    }
    cached = {true, false, {}};
    if (!widened(geoms.box(pair.a), pair.reach).overlaps(geoms.box(pair.b))) continue;
    ++counts.candidates;
    const Vec3 origin = geoms.shape(pair.a).kind == Kind::half_spaces ? geoms.motion(pair.b).x0
                                                                      : geoms.motion(pair.a).x0;
    const auto touch_within = [&](double threshold) {
      SupportShape a = geoms.mover(pair.a, origin), b = geoms.mover(pair.b, origin);
      const bool polytopes = geoms.shape(pair.a).polytope() && geoms.shape(pair.b).polytope();
      return polytopes && threshold == 0 ? polytopes_touch(geoms, pair, origin, a, b)
                                         : first_contact(a, b, threshold, 0);
    };
    Touch touch = touch_within(0);
    if (!touch.hit && pair.reach > 0) touch = touch_within(pair.reach);
    if (!touch.hit) continue;
    cached.hit = true;
    cached.row = {pair.a, pair.b, -1, touch.t, touch.distance, touch.point + origin, touch.normal};
    rows->push_back(cached.row);
  }
  return counts;
}

Counts find_flex(Geoms& geoms, const Poses& poses, const double* x_t0, const double* x_t1,
                 const std::int32_t* elements, std::size_t count, int corners, double radius,
                 const std::vector<FlexPair>& pairs, std::vector<Row>* rows) {
  constexpr std::size_t block = 32;  // simplices that share a box
  geoms.update(poses);
  Counts counts;
  counts.moved = geoms.moved();
  std::vector<Aabb> boxes(count), blocks((count + block - 1) / block);
  for (std::size_t e = 0; e < count; ++e) {
    Aabb& box = boxes[e];
    for (int i = 0; i < corners; ++i)
      for (const double* x : {x_t0, x_t1}) box.add(x + 3 * elements[corners * e + i]);
    box.widen(radius * (1 + 4 * unit_roundoff));
    blocks[e / block].add(box);
  }
  for (const FlexPair& pair : pairs) {
    const Aabb reach = widened(geoms.box(pair.geom), pair.reach);
    for (std::size_t group = 0; group < blocks.size(); ++group) {
      if (!reach.overlaps(blocks[group])) continue;
      for (std::size_t e = block * group; e < std::min(count, block * (group + 1)); ++e) {
        if (pair.skip[e] || !reach.overlaps(boxes[e])) continue;
        ++counts.candidates;
        const double *start[4], *end[4];
        for (int i = 0; i < corners; ++i)
          start[i] = x_t0 + 3 * elements[corners * e + i],
          end[i] = x_t1 + 3 * elements[corners * e + i];
        const Vec3 origin = geometry::load(start[0]);
        SupportShape a = geoms.mover(pair.geom, origin);
        SupportShape b(start, end, corners, radius, origin);
        Touch touch = first_contact(a, b, 0, 0);
        if (!touch.hit && pair.reach > 0) touch = first_contact(a, b, pair.reach, 0);
        if (touch.hit)
          rows->push_back({pair.geom, 0, static_cast<std::int32_t>(e), touch.t, touch.distance,
                           touch.point + origin, touch.normal});
      }
    }
  }
  return counts;
}

bool simplices_touch(const double* x_t0, const double* x_t1, const std::int32_t* a,
                     const std::int32_t* b, int corners, double distance, Touch* touch) {
  const double *start[2][4], *end[2][4];
  for (int i = 0; i < corners; ++i) {
    start[0][i] = x_t0 + 3 * a[i], end[0][i] = x_t1 + 3 * a[i];
    start[1][i] = x_t0 + 3 * b[i], end[1][i] = x_t1 + 3 * b[i];
  }
  const Vec3 origin = geometry::load(start[0][0]);
  SupportShape x(start[0], end[0], corners, 0.5 * distance, origin),
      y(start[1], end[1], corners, 0.5 * distance, origin);
  *touch = first_contact(x, y, 0, 0);
  touch->point = touch->point + origin;
  return touch->hit;
}

}  // namespace tauguard::contacts
