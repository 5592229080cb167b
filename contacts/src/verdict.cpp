#include "verdict.hpp"

#include <algorithm>
#include <cmath>

namespace tauguard::contacts {
namespace {

// Shapes nearer than the fraction `resting` of their size count as touching at the start. Sweeps
// report a touch only below the fraction `touching`, so a resting pair that separates is no hit.
constexpr double resting = 1e-5;
constexpr double touching = 1e-6;
// Distances in unit roundoffs of the positions. `rounded` is the margin by which pairs must be
// apart at the start. A sweep of the shapes of the last level ends at a distance of at least 128
// (first_contact). The smaller `left_over` is the distance that they must still have afterwards.
constexpr double rounded = 512, left_over = 64;
constexpr double slack = 1e-12;    // bound on the relative rounding of sums of distances
constexpr double whole_chord = 2;  // longest chord of a rotation of radius 1
// Times at which eroded shapes are tested for overlap, as fractions of the rest of the step.
constexpr double later[] = {1.0, 0.5, 0.25};

// By how much two shapes are further apart at time t than required; above 0, they are apart. `n`
// becomes the direction from a to b in which this was found.
double gap_at(SupportShape& a, SupportShape& b, double t, double share, double roundoffs, Vec3* n) {
  a.move_to(t), b.move_to(t);
  const double radii = a.radius() + b.radius();
  const double needed = radii + share * (a.reach() + b.reach() + radii) +
                        roundoffs * unit_roundoff * (a.magnitude() + b.magnitude());
  const Distance d = distance_of(a, b, Vec3{}, needed);
  *n = d.n;
  return d.overlap ? -INFINITY : d.lower - needed;
}

bool overlap_at(SupportShape& a, SupportShape& b, double t) {
  a.move_to(t), b.move_to(t);
  const double radii = a.radius() + b.radius();
  const Distance d = distance_of(a, b, Vec3{}, radii);
  return d.overlap || d.upper < radii;
}

// The memory of a pair from earlier steps. apart: the eroded shapes of some level were apart.
// sunk: the eroded shapes of every level overlapped.
enum : char { unknown, apart, sunk };

// Judges a pair with the moving shapes `a_at(level)` and `b_at(level)`. Deeper eroded shapes never
// touch before shallower ones, so each sweep starts where the last one ended. A pair is judged at
// the shallowest level at which it is apart at the start. There is no sweep if it certainly stays
// apart at this level by earlier steps (`lasts(level)`) or by its gap (`stays(level, gap, n)`).
// Whether the shapes of the next level meet is always found; which deeper ones do, as `depth` says.
template <class MakeA, class MakeB, class Lasts, class Stays>
bool judged(const MakeA& a_at, const MakeB& b_at, int levels, const Lasts& lasts,
            const Stays& stays, Depth depth, char* known, Hit* hit) {
  double close = touching, gap = 0;
  Vec3 n{};
  const auto touch = [&](int level, double from) {
    SupportShape a = a_at(level), b = b_at(level);
    return first_contact(a, b, 0, from, close);
  };
  const auto separate = [&](int level, double t) {
    SupportShape a = a_at(level), b = b_at(level);
    gap = gap_at(a, b, t, resting, rounded, &n);
    return gap > 0;
  };
  // Whether the shapes meet after `from`. If they overlap at a later time, no sweep is needed.
  const auto meet = [&](int level, double* from) {
    for (const double share : later) {
      SupportShape a = a_at(level), b = b_at(level);
      if (overlap_at(a, b, *from + share * (1 - *from))) return true;
    }
    const Touch touched = touch(level, *from);
    if (touched.hit) *from = touched.t;
    return touched.hit;
  };
  // If the shapes of the last level have never met, they may be as near as rounding allows, but
  // must not meet now.
  const auto hardly = [&] {
    SupportShape a = a_at(levels - 1), b = b_at(levels - 1);
    return gap_at(a, b, 0, 0, left_over, &n) > 0;
  };
  int level = 0;
  for (; level < levels; ++level) {
    if (lasts(level)) return *known = apart, false;
    if (separate(level, 0)) break;
  }
  if (level == levels && *known == apart && hardly()) level = levels - 1, close = 0;
  const bool lost = level == levels && *known == apart;
  *known = level == levels ? sunk : apart;
  hit->level = hit->deepest = level, hit->t = 0;
  if (level == levels) return lost;
  if (close > 0 && stays(level, gap, n)) return false;
  double from = 0;
  if (level == 0) {
    // Most pairs that touch do so until the end, and nothing deeper meets. Then the time of the
    // touch is not needed.
    if (levels > 1 && !separate(0, 1) && !touch(1, 0).hit) return false;
    const Touch whole = touch(0, 0);
    if (!whole.hit) return false;
    from = hit->t = whole.t;
    level = 1;
  }
  const int trigger = level;
  bool met = false;
  for (; level < levels && meet(level, &from); ++level) {
    met = true, hit->deepest = level;
    if (depth == Depth::none) break;
    if (depth == Depth::last) level = std::max(level, levels - 2);
  }
  if (met) return hit->level = trigger, true;
  return hit->level == 0 && separate(0, 1);  // touched and parted again, or only came close
}

}  // namespace

int Verdict::add(Shape shape, int body, const LocalFrame& in_body) {
  const double size = shape.extent() + shape.radius;
  const double extent = norm(in_body.at) + shape.extent() + shape.radius;
  const bool plane = shape.kind == Kind::half_spaces;
  entries_.push_back({std::move(shape), in_body, body, extent, size});
  boxes_.emplace_back(), boxed_.push_back(0);
  if (std::find(bodies_.begin(), bodies_.end(), body) == bodies_.end()) bodies_.push_back(body);
  const std::size_t n = static_cast<std::size_t>(body) + 1;
  if (n > still_.size()) {
    const double none[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    motions_.resize(n, RigidMotion(none, none + 1, none + 1));
    stamps_.resize(n, 0), moved_.resize(n, 0), ways_.resize(n), still_.resize(n, 0);
    extents_.resize(n, 0);
    last_.resize(24 * n, NAN);
  }
  extents_[body] = std::max(extents_[body], plane ? INFINITY : extent);
  return static_cast<int>(entries_.size()) - 1;
}

void Verdict::add_pair(std::vector<std::int32_t> a, std::vector<std::int32_t> b) {
  reserves_.push_back({entries_[a[0]].body, entries_[b[0]].body});
  pairs_.push_back({std::move(a), std::move(b), unknown});
}

void Verdict::add_flex_pair(std::vector<std::int32_t> a, std::vector<double> radii,
                            std::vector<std::int32_t> elements, int corners,
                            std::vector<std::uint8_t> skip) {
  std::vector<char> known(skip.size(), unknown);
  flex_pairs_.push_back({std::move(a), std::move(radii), std::move(elements), corners,
                         std::move(skip), std::move(known)});
}

const RigidMotion& Verdict::motion(int body) {
  if (moved_[body] != stamps_[body]) {
    const double* x = last_.data() + 24 * body;
    motions_[body] = motion_between(x, x + 3, x + 12, x + 15);
    moved_[body] = stamps_[body];
  }
  return motions_[body];
}

const Aabb& Verdict::box(int entry) {
  const int body = entries_[entry].body;
  if (boxed_[entry] != stamps_[body]) {
    boxes_[entry] = swept(mover(entry, Vec3{}), motion(body));
    boxed_[entry] = stamps_[body];
  }
  return boxes_[entry];
}

SupportShape Verdict::mover(int entry, const Vec3& origin) {
  const Entry& e = entries_[entry];
  return SupportShape(e.shape, e.in_body, motion(e.body), origin);
}

// The largest displacement of a point of the shape relative to a point that moves by `drift`.
double Verdict::travel(int entry, const Vec3& drift) {
  const Entry& e = entries_[entry];
  const RigidMotion& own = motion(e.body);
  if (own.speed == 0) return norm(own.linear - drift);
  return norm(own.linear - drift) + own.speed * e.extent;
}

void Verdict::update(const Poses& p) {
  const auto distance = [](const double* from, const double* to, int count) {
    double sum = 0;
    for (int k = 0; k < count; ++k) sum += (to[k] - from[k]) * (to[k] - from[k]);
    return std::sqrt(sum);
  };
  // In a rotation of at most half a turn no point is further from its start or its end than the
  // chord 2 sin(angle / 2), per metre from the axis. The norm of the difference of the rotation
  // matrices is sqrt(2) times this chord.
  const auto chord = [&](const double* from, const double* to) {
    return M_SQRT1_2 * distance(from, to, 9);
  };
  for (const int b : bodies_) {
    double now[24], *last = last_.data() + 24 * b;
    std::copy_n(p.xpos_t0 + 3 * b, 3, now), std::copy_n(p.xmat_t0 + 9 * b, 9, now + 3);
    std::copy_n(p.xpos_t1 + 3 * b, 3, now + 12), std::copy_n(p.xmat_t1 + 9 * b, 9, now + 15);
    const double* turn = p.turn ? p.turn + 3 * b : nullptr;
    // Poses alone do not determine the number of turns.
    const bool fresh = turn || ways_[b].chord >= whole_chord || !std::equal(now, now + 24, last);
    Way way;
    if (!fresh && still_[b]) {
      ways_[b] = way;
      continue;
    }
    stamps_[b] += fresh;
    still_[b] = std::equal(now, now + 12, now + 12);
    way.linear = distance(now, now + 12, 3), way.chord = chord(now + 3, now + 15);
    if (turn) {
      motions_[b] = motion_between(now, now + 3, now + 12, now + 15, turn);
      moved_[b] = stamps_[b];
      still_[b] = still_[b] && motions_[b].speed == 0;
      if (motions_[b].speed > M_PI) way.chord = whole_chord;
    }
    double linear = way.linear, chords = way.chord;
    if (stamps_[b] > 1 && !std::equal(now, now + 12, last + 12))
      linear += distance(last + 12, now, 3), chords += chord(last + 15, now + 3);
    way.since = (chords > 0 ? linear + chords * extents_[b] : linear) * (1 + slack);
    ways_[b] = way;
    std::copy_n(now, 24, last);
  }
}

// A bound on how far rotation moves points of the pair in the step (sum of both partners). Infinite
// for a rotating plane.
double Verdict::turning(const Pair& pair) const {
  double sum = 0;
  for (const int entry : {pair.a[0], pair.b[0]}) {
    const Entry& e = entries_[entry];
    const Way& w = ways_[e.body];
    if (e.shape.kind == Kind::half_spaces && w.chord > 0) return INFINITY;
    sum += w.chord * e.extent;
  }
  return sum;
}

// By how much the balls around both whole shapes are further apart than required, at the end of the
// step.
double Verdict::gap_of_balls(const Pair& pair) const {
  const Entry* const e[] = {&entries_[pair.a[0]], &entries_[pair.b[0]]};
  Vec3 centre[2], up{};
  for (int i = 0; i < 2; ++i) {
    const double *x = last_.data() + 24 * e[i]->body + 12, *r = x + 3;
    const Vec3 &at = e[i]->in_body.at, *rows = e[i]->in_body.row;
    for (int k = 0; k < 3; ++k) {
      const Vec3 row = geometry::load(r + 3 * k);
      centre[i][k] = x[k] + dot(row, at);
      if (i == 0) up[k] = dot(row, Vec3{rows[0][2], rows[1][2], rows[2][2]});
    }
  }
  const Vec3 between = centre[1] - centre[0];
  const bool plane = e[0]->shape.kind == Kind::half_spaces;
  const double needed = 2 * resting * (e[0]->extent + e[1]->extent) +
                        rounded * unit_roundoff * (norm(centre[0]) + norm(centre[1]));
  return (plane ? dot(up, between) : norm(between)) - e[0]->size - e[1]->size - needed;
}

// Whether the shapes of a level stay apart in the step, if their gap along n at the start is `gap`.
// If so, the remaining gap at the end becomes the reserve of the pair (verdict.hpp).
bool Verdict::stays_apart(std::size_t number, int level, double gap, const Vec3& n) {
  const Pair& pair = pairs_[number];
  const double* const x[] = {last_.data() + 24 * entries_[pair.a[0]].body,
                             last_.data() + 24 * entries_[pair.b[0]].body};
  Vec3 drift[2];
  for (int i = 0; i < 2; ++i) drift[i] = geometry::load(x[i] + 12) - geometry::load(x[i]);
  const double closing = dot(n, drift[0] - drift[1]), turned = turning(pair) * (1 + slack);
  const double error = slack * (norm(drift[0]) + norm(drift[1]));
  if (!(gap > std::max(0.0, closing) + turned + error)) return false;
  reserves_[number].level = level, reserves_[number].left = gap - closing - turned - error;
  return true;
}

void Verdict::judge_rigid(std::size_t number, Depth depth, std::vector<Hit>* hits) {
  Reserve& reserve = reserves_[number];
  const double way = ways_[reserve.a].since + ways_[reserve.b].since;
  reserve.left = (reserve.left - way) * (1 - 4 * unit_roundoff);  // a margin for rounding
  const auto lasts = [&](int level) { return level == reserve.level && reserve.left > 0; };
  if (lasts(0)) return;
  if (still_[reserve.a] && still_[reserve.b]) return;
  Pair& pair = pairs_[number];
  const Entry &a = entries_[pair.a[0]], &b = entries_[pair.b[0]];
  if (const double gap = gap_of_balls(pair); gap > way) {
    reserve.level = 0, reserve.left = gap;
    return void(pair.known = apart);
  }
  if (!box(pair.a[0]).overlaps(box(pair.b[0]))) return void(pair.known = apart);
  const bool plane = a.shape.kind == Kind::half_spaces;
  const Vec3 origin = motion(plane ? b.body : a.body).x0;
  Hit hit{static_cast<std::int32_t>(number), -1, 0, 0, 0, 0};
  if (!judged(
          [&](int level) { return mover(pair.a[level], origin); },
          [&](int level) { return mover(pair.b[level], origin); }, static_cast<int>(pair.a.size()),
          lasts,
          [&](int level, double gap, const Vec3& n) { return stays_apart(number, level, gap, n); },
          depth == Depth::all ? Depth::last : depth, &pair.known, &hit))
    return;
  const Vec3 drift = plane ? Vec3{} : motion(a.body).linear;
  hit.way = travel(pair.b[0], drift);
  if (!plane && motion(a.body).speed != 0) hit.way += travel(pair.a[0], drift);
  hits->push_back(hit);
}

void Verdict::judge_flex(std::size_t number, const double* x_t0, const double* x_t1, Depth depth,
                         std::vector<Hit>* hits) {
  constexpr std::size_t block = 32;  // simplices that share a box
  FlexPair& pair = flex_pairs_[number];
  const std::size_t count = pair.skip.size();
  const Aabb& near = box(pair.a[0]);
  const double radius = pair.radii[0] * (1 + 4 * unit_roundoff);
  const auto box_of = [&](std::size_t begin, std::size_t end) {
    Aabb box;
    for (std::size_t i = pair.corners * begin; i < pair.corners * end; ++i)
      box.add(x_t0 + 3 * pair.elements[i]), box.add(x_t1 + 3 * pair.elements[i]);
    box.widen(radius);
    return box;
  };
  const Entry& geom = entries_[pair.a[0]];
  const RigidMotion& motion = this->motion(geom.body);
  const Vec3& drift = motion.linear;
  const bool sweeps = geom.shape.kind == Kind::half_spaces && motion.speed > 0;
  const double turned = sweeps ? INFINITY : motion.speed * geom.extent;
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
      const auto stays = [&](int, double gap, const Vec3& n) {
        double closing = 0, most = norm(drift);
        for (int i = 0; i < pair.corners; ++i) {
          const Vec3 moved = geometry::load(stop[i]) - geometry::load(start[i]);
          closing = std::max(closing, dot(n, drift - moved)), most = std::max(most, norm(moved));
        }
        return gap > (closing + turned) * (1 + slack) + 2 * slack * most;
      };
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
                  static_cast<int>(pair.a.size()), [](int) { return false; }, stays, depth,
                  &pair.known[e], &hit))
        continue;
      for (int i = 0; i < pair.corners; ++i) {
        const Vec3 moved = geometry::load(stop[i]) - geometry::load(start[i]) - drift;
        hit.way = std::max(hit.way, norm(moved));
      }
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
  for (Reserve& reserve : reserves_) reserve.left = -INFINITY;
  for (FlexPair& pair : flex_pairs_) std::fill(pair.known.begin(), pair.known.end(), unknown);
}

void Verdict::judge(const Poses& poses, const double* x_t0, const double* x_t1, Depth depth,
                    std::vector<Hit>* hits) {
  update(poses);
  for (std::size_t i = 0; i < pairs_.size(); ++i) judge_rigid(i, depth, hits);
  for (std::size_t i = 0; i < flex_pairs_.size(); ++i) judge_flex(i, x_t0, x_t1, depth, hits);
}

}  // namespace tauguard::contacts
