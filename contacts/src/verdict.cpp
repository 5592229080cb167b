#include "verdict.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

// Shapes nearer than the fraction `resting` of their size count as touching at the start. Sweeps
// report a touch below the fraction `touching`, so a resting pair that separates is no hit.
constexpr double resting = 1e-5;
constexpr double touching = 1e-6;
// Distances in unit roundoffs of the positions. `rounded` is the margin by which pairs must be
// apart at the start. `left_over` is below the least distance that a sweep of the last eroded
// shapes leaves (first_contact leaves 128).
constexpr double rounded = 512, left_over = 64;

bool apart_at(SupportShape& a, SupportShape& b, double t, double share, double roundoffs) {
  a.move_to(t), b.move_to(t);
  const double radii = a.radius() + b.radius();
  const double needed = radii + share * (a.reach() + b.reach() + radii) +
                        roundoffs * unit_roundoff * (a.magnitude() + b.magnitude());
  const Distance d = distance_of(a, b, Vec3{}, needed);
  return !d.overlap && d.lower > needed;
}

// The memory of a pair from earlier steps. apart: the eroded shapes of some level were apart.
// sunk: the eroded shapes of every level overlapped.
enum : char { unknown, apart, sunk };

// `a_at(level)` and `b_at(level)` make the moving shapes of a pair. A deeper eroded shape never
// touches before a shallower one, so each sweep continues where the last one ended.
template <class MakeA, class MakeB>
bool judged(const MakeA& a_at, const MakeB& b_at, int levels, char* known, Hit* hit) {
  double close = touching;
  const auto touch = [&](int level, double from) {
    SupportShape a = a_at(level), b = b_at(level);
    return first_contact(a, b, 0, from, close);
  };
  const auto separate = [&](int level, double t) {
    SupportShape a = a_at(level), b = b_at(level);
    return apart_at(a, b, t, resting, rounded);
  };
  // If the shapes of the last level have never met, they may be as near as rounding allows, but
  // must not meet now.
  const auto hardly = [&] {
    SupportShape a = a_at(levels - 1), b = b_at(levels - 1);
    return apart_at(a, b, 0, 0, left_over);
  };
  int level = 0;
  while (level < levels && !separate(level, 0)) ++level;
  if (level == levels && *known == apart && hardly()) level = levels - 1, close = 0;
  const bool lost = level == levels && *known == apart;
  *known = level == levels ? sunk : apart;
  hit->level = hit->deepest = level, hit->t = 0;
  if (level == levels) return lost;
  double from = 0;
  if (level == 0) {
    const Touch whole = touch(0, 0);
    if (!whole.hit) return false;
    from = hit->t = whole.t;
    level = 1;
  }
  const int trigger = level;
  for (; level < levels; ++level) {
    const Touch deeper = touch(level, from);
    if (!deeper.hit) break;
    hit->deepest = level, from = deeper.t;
  }
  if (level > trigger) return hit->level = trigger, true;
  return hit->level == 0 && separate(0, 1);  // touched and parted again, or only came close
}

}  // namespace

int Verdict::add(Shape shape, int body, const LocalFrame& in_body) {
  const double extent = norm(in_body.at) + shape.extent() + shape.radius;
  entries_.push_back({std::move(shape), in_body, body, extent});
  whole_.push_back(0), boxes_.emplace_back();
  if (std::find(bodies_.begin(), bodies_.end(), body) == bodies_.end()) bodies_.push_back(body);
  const std::size_t n = static_cast<std::size_t>(body) + 1;
  if (n > still_.size()) {
    const double none[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    still_.resize(n, 0), fresh_.resize(n, 1), last_.resize(24 * n, NAN);
    motions_.resize(n, RigidMotion(none, none + 1, none + 1));
  }
  return static_cast<int>(entries_.size()) - 1;
}

void Verdict::add_pair(std::vector<std::int32_t> a, std::vector<std::int32_t> b) {
  whole_[a[0]] = whole_[b[0]] = 1;
  pairs_.push_back({std::move(a), std::move(b), unknown});
}

void Verdict::add_flex_pair(std::vector<std::int32_t> a, std::vector<double> radii,
                            std::vector<std::int32_t> elements, int corners,
                            std::vector<std::uint8_t> skip) {
  whole_[a[0]] = 1;
  std::vector<char> known(skip.size(), unknown);
  flex_pairs_.push_back({std::move(a), std::move(radii), std::move(elements), corners,
                         std::move(skip), std::move(known)});
}

SupportShape Verdict::mover(int entry, const Vec3& origin) const {
  const Entry& e = entries_[entry];
  return SupportShape(e.shape, e.in_body, motions_[e.body], origin);
}

// The largest displacement of a point of the shape relative to a point that moves by `drift`.
double Verdict::travel(int entry, const Vec3& drift) const {
  const Entry& e = entries_[entry];
  const RigidMotion& motion = motions_[e.body];
  if (motion.speed == 0) return norm(motion.linear - drift);
  return norm(motion.linear - drift) + motion.speed * e.extent;
}

void Verdict::update(const Poses& p) {
  for (const int b : bodies_) {
    double now[24];
    std::copy_n(p.xpos_t0 + 3 * b, 3, now), std::copy_n(p.xmat_t0 + 9 * b, 9, now + 3);
    std::copy_n(p.xpos_t1 + 3 * b, 3, now + 12), std::copy_n(p.xmat_t1 + 9 * b, 9, now + 15);
    const double* turn = p.turn ? p.turn + 3 * b : nullptr;
    fresh_[b] = turn || !std::equal(now, now + 24, last_.begin() + 24 * b);
    if (!fresh_[b]) continue;
    std::copy_n(now, 24, last_.begin() + 24 * b);
    motions_[b] = motion_between(now, now + 3, now + 12, now + 15, turn);
    still_[b] = motions_[b].speed == 0 && std::equal(now, now + 12, now + 12);
    if (turn && motions_[b].speed > M_PI)
      last_[24 * b] = NAN;  // poses alone do not determine the number of turns
  }
  for (std::size_t e = 0; e < entries_.size(); ++e)
    if (whole_[e] && fresh_[entries_[e].body])
      boxes_[e] = swept(mover(static_cast<int>(e), Vec3{}), motions_[entries_[e].body]);
}

void Verdict::judge_rigid(std::size_t number, std::vector<Hit>* hits) {
  Pair& pair = pairs_[number];
  const Entry &a = entries_[pair.a[0]], &b = entries_[pair.b[0]];
  if (still_[a.body] && still_[b.body]) return;
  if (!boxes_[pair.a[0]].overlaps(boxes_[pair.b[0]])) return void(pair.known = apart);
  const bool plane = a.shape.core == Core::half_space;
  const Vec3 origin = motions_[plane ? b.body : a.body].x0;
  Hit hit{static_cast<std::int32_t>(number), -1, 0, 0, 0, 0};
  if (!judged([&](int level) { return mover(pair.a[level], origin); },
              [&](int level) { return mover(pair.b[level], origin); },
              static_cast<int>(pair.a.size()), &pair.known, &hit))
    return;
  const Vec3 drift = plane ? Vec3{} : motions_[a.body].linear;
  hit.way = travel(pair.b[0], drift);
  if (!plane && motions_[a.body].speed != 0) hit.way += travel(pair.a[0], drift);
  hits->push_back(hit);
}

void Verdict::judge_flex(std::size_t number, const double* x_t0, const double* x_t1,
                         std::vector<Hit>* hits) {
  constexpr std::size_t block = 32;  // simplices that share a box
  FlexPair& pair = flex_pairs_[number];
  const std::size_t count = pair.skip.size();
  const Aabb& near = boxes_[pair.a[0]];
  const double radius = pair.radii[0] * (1 + 4 * unit_roundoff);
  const auto box_of = [&](std::size_t begin, std::size_t end) {
    Aabb box;
    for (std::size_t i = pair.corners * begin; i < pair.corners * end; ++i)
      box.add(x_t0 + 3 * pair.elements[i]), box.add(x_t1 + 3 * pair.elements[i]);
    box.widen(radius);
    return box;
  };
  const Vec3& drift = motions_[entries_[pair.a[0]].body].linear;
  for (std::size_t begin = 0; begin < count; begin += block) {
    const std::size_t end = std::min(count, begin + block);
    if (!near.overlaps(box_of(begin, end))) continue;
    for (std::size_t e = begin; e < end; ++e) {
      if (pair.skip[e] || !near.overlaps(box_of(e, e + 1))) continue;
      const double *start[4], *stop[4];
      for (int i = 0; i < pair.corners; ++i) {
        start[i] = x_t0 + 3 * pair.elements[pair.corners * e + i];
        stop[i] = x_t1 + 3 * pair.elements[pair.corners * e + i];
      }
      const Vec3 origin = geometry::load(start[0]);
      Hit hit{static_cast<std::int32_t>(pairs_.size() + number),
              static_cast<std::int32_t>(e),
              0,
              0,
              0,
              0};
      if (!judged([&](int level) { return mover(pair.a[level], origin); },
                  [&](int level) {
                    return SupportShape(start, stop, pair.corners, pair.radii[level], origin);
                  },
                  static_cast<int>(pair.a.size()), &pair.known[e], &hit))
        continue;
      for (int i = 0; i < pair.corners; ++i) {
        const Vec3 moved = geometry::load(stop[i]) - geometry::load(start[i]) - drift;
        hit.way = std::max(hit.way, norm(moved));
      }
      const RigidMotion& motion = motions_[entries_[pair.a[0]].body];
      if (motion.speed != 0) hit.way += travel(pair.a[0], drift);
      hits->push_back(hit);
    }
  }
}

std::vector<char> Verdict::known(std::size_t pair) const {
  if (pair < pairs_.size()) return {pairs_[pair].known};
  pair -= pairs_.size();
  return pair < flex_pairs_.size() ? flex_pairs_[pair].known : std::vector<char>{};
}

void Verdict::set_known(std::size_t pair, const std::vector<char>& known) {
  if (known.size() != this->known(pair).size() || known.empty()) return;
  if (pair < pairs_.size())
    pairs_[pair].known = known[0];
  else
    flex_pairs_[pair - pairs_.size()].known = known;
}

std::vector<int> Verdict::sunk_pairs() const {
  std::vector<int> out;
  for (std::size_t i = 0; i < pairs_.size() + flex_pairs_.size(); ++i) {
    const std::vector<char> all = known(i);
    if (std::find(all.begin(), all.end(), sunk) != all.end()) out.push_back(static_cast<int>(i));
  }
  return out;
}

void Verdict::forget() {
  for (Pair& pair : pairs_) pair.known = unknown;
  for (FlexPair& pair : flex_pairs_) std::fill(pair.known.begin(), pair.known.end(), unknown);
}

void Verdict::judge(const Poses& poses, const double* x_t0, const double* x_t1,
                    std::vector<Hit>* hits) {
  update(poses);
  for (std::size_t i = 0; i < pairs_.size(); ++i) judge_rigid(i, hits);
  for (std::size_t i = 0; i < flex_pairs_.size(); ++i) judge_flex(i, x_t0, x_t1, hits);
}

}  // namespace tauguard::contacts
