// Guarded steps and the kernel of moving convex shapes without an interpreter, for the sanitizers:
// random and absurd scenes, several threads, and single pairs of shapes. Prints what it tried.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <thread>

#include "guarded_scene.hpp"
#include "sweep.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace {

using namespace tauguard::contacts;
using guarded::Guarded;
using guarded::uniform;

std::vector<double> parameters(const mjModel* m) {
  std::vector<double> out = {m->opt.timestep, double(m->opt.disableflags), double(m->opt.solver),
                             double(m->opt.iterations)};
  out.insert(out.end(), m->geom_margin, m->geom_margin + m->ngeom);
  out.insert(out.end(), m->geom_solref, m->geom_solref + mjNREF * m->ngeom);
  out.insert(out.end(), m->geom_solimp, m->geom_solimp + mjNIMP * m->ngeom);
  out.insert(out.end(), m->geom_priority, m->geom_priority + m->ngeom);
  out.insert(out.end(), m->flex_solref, m->flex_solref + mjNREF * m->nflex);
  return out;
}

std::vector<double> state_of(const mjModel* m, const mjData* d) {
  std::vector<double> out(mj_stateSize(m, mjSTATE_INTEGRATION));
  mj_getState(m, d, out.data(), mjSTATE_INTEGRATION);
  return out;
}

bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && !std::memcmp(a.data(), b.data(), 8 * a.size());
}

struct Tally {
  int steps = 0, rolled_back = 0;
};

// Puts the paddle somewhere near, turned in some way.
void move(Guarded& g, bool hard) {
  mjData* d = g.scene.data;
  for (int k = 0; k < 3; ++k) d->mocap_pos[k] = uniform(g.random, -0.3, 0.3);
  for (int k = 0; k < 4; ++k) d->mocap_quat[k] = uniform(g.random, -1, 1);
  if (hard && g.random() % 10 == 0) d->mocap_pos[0] = std::nan("");
  if (hard && g.random() % 10 == 0) std::fill_n(d->mocap_quat, 4, 0.0);
}

// A step that stands has the bits of mj_step; a body is not below the floor unless that is said.
Tally play(Guarded& g, bool hard, int steps) {
  mjModel* m = g.scene.model;
  mjData* d = g.scene.data;
  mjData* twin = mj_makeData(m);
  const std::vector<double> before = parameters(m);
  for (int i = 0; i < m->nv; ++i)
    if (i % 6 < 3 && i < 6 * (m->nbody - 1))
      d->qvel[i] = i % 3 < 2 ? uniform(g.random, -3, 3) : uniform(g.random, -40, 0);
  Tally tally;
  bool lost = false;
  for (int k = 0; k < steps; ++k) {
    if (hard && g.random() % 10 == 0) {
      const double strange[] = {
          std::nan(""), std::numeric_limits<double>::infinity(), 1e300, 1e30, 5e-324, 1e6};
      (g.random() % 2 ? d->qvel[g.random() % m->nv] : d->qpos[g.random() % m->nq]) =
          strange[g.random() % 6];
    }
    if (g.random() % 3 == 0) move(g, hard);
    const std::vector<double> first = state_of(m, d);
    const bool quiet = g.stepper->step(nullptr);
    const Report& report = g.stepper->report();
    ++tally.steps;
    tally.rolled_back += report.rolled_back;
    lost = lost || !report.passed.empty() || !report.impact_zones.empty();
    if (!report.rolled_back) {
      mj_setState(m, twin, first.data(), mjSTATE_INTEGRATION);
      mj_step(m, twin);
      check(same(state_of(m, twin), state_of(m, d)), "a step that stands is not mj_step's");
    }
    check(quiet || report.steps >= 1, "a report without a step");
    if (!hard && !lost)
      for (int b = 1; b < m->nbody; ++b)
        check(m->body_geomnum[b] == 0 || m->body_mocapid[b] >= 0 || d->xpos[3 * b + 2] > -0.1,
              "a body below the floor");
  }
  check(same(parameters(m), before), "the guard wrote to the model");
  mj_deleteData(twin);
  return tally;
}

Tally scenes(Random& random, int rounds) {
  Tally all;
  for (int round = 0; round < rounds; ++round) {
    const std::uint64_t seed = random();
    const bool cloth = round % 3 == 2, hard = round % 2, reset = round % 4 < 2;
    std::vector<std::vector<double>> ends(3);
    std::vector<Tally> tallies(3);
    // Scenes are compiled before there are threads: ThreadSanitizer does not see what orders those
    // inside MuJoCo's library.
    std::vector<std::unique_ptr<Guarded>> scenes;
    for (std::size_t k = 0; k < ends.size(); ++k)
      scenes.emplace_back(new Guarded(seed, cloth, reset));
    std::vector<std::thread> threads;
    for (std::size_t k = 0; k < ends.size(); ++k)
      threads.emplace_back([&, k] {
        const tauguard::geometry::RoundToNearest guard;
        Guarded& g = *scenes[k];
        tallies[k] = play(g, hard, cloth ? 20 : 60);
        ends[k] = state_of(g.scene.model, g.scene.data);
      });
    for (auto& thread : threads) thread.join();
    check(same(ends[0], ends[1]) && same(ends[1], ends[2]), "threads change bits");
    for (const Tally& t : tallies) all.steps += t.steps, all.rolled_back += t.rolled_back;
  }
  return all;
}

constexpr Kind curved_or_polytope[] = {Kind::points,    Kind::segments, Kind::ellipsoids,
                                       Kind::cylinders, Kind::cones,    Kind::boxes,
                                       Kind::hulls};

Shape shape_of(Random& random, bool hard) {
  Shape shape{curved_or_polytope[random() % 7], {}, 0, {}, {}, {}, {}, {}};
  const auto number = [&] {
    return hard ? std::fabs(hard_number(random)) : uniform(random, 0.05, 0.5);
  };
  for (double& s : shape.size) s = number();
  if (shape.kind == Kind::points || shape.kind == Kind::segments) shape.radius = number();
  if (shape.kind == Kind::hulls)
    for (std::size_t k = 1 + random() % 9; k > 0; --k) {
      for (auto* axis : {&shape.x, &shape.y, &shape.z})
        axis->push_back(hard ? hard_number(random) : uniform(random, -0.4, 0.4));
    }
  return shape;
}

struct Way {
  double xpos[2][6] = {}, xmat[2][18];

  Way(Random& random, double far, bool hard) {
    for (auto& row : xmat)
      for (int b = 0; b < 2; ++b) {
        double quat[4];
        for (double& x : quat) x = uniform(random, -1, 1);
        mju_normalize4(quat);
        mju_quat2Mat(row + 9 * b, quat);
      }
    for (auto& row : xpos)
      for (double& x : row) x = hard ? hard_number(random) : uniform(random, -far, far);
  }
  Poses poses() const { return {xpos[0], xmat[0], xpos[1], xmat[1]}; }
};

const LocalFrame in_place{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {0, 0, 0}};

// When two balls of radius r first touch on straight ways; infinite if never.
double balls(const Way& w, double r) {
  double a = 0, b = 0, c = -r * r;
  for (int k = 0; k < 3; ++k) {
    const double x = w.xpos[0][3 + k] - w.xpos[0][k], v = w.xpos[1][3 + k] - w.xpos[1][k] - x;
    a += v * v, b += x * v, c += x * x;
  }
  if (c <= 0) return 0;
  const double root = b * b - a * c;
  return root < 0 || b >= 0 ? INFINITY : (-b - std::sqrt(root)) / a;
}

// Whether the cores share a point at a sampled time before `t`.
bool touch_before(Geoms& geoms, double t) {
  SupportShape a = geoms.mover(0, Vec3{}), b = geoms.mover(1, Vec3{});
  const double radii = a.radius() + b.radius();
  for (int k = 0; k < (t > 0 ? 24 : 0); ++k) {
    a.move_to(t * k / 24), b.move_to(t * k / 24);
    const Distance d = distance_of(a, b, Vec3{}, INFINITY);
    if (d.upper < radii - 1e-6 || (d.overlap && d.upper <= 0 && d.lower < -1e-6)) return true;
  }
  return false;
}

// Pairs of shapes: never late, balls at their time to rounding, and no number does harm.
int shapes(Random& random, int rounds) {
  for (int round = 0; round < 100 * rounds; ++round) {
    const bool hard = round % 3 == 2;
    Geoms geoms;
    const Shape a = shape_of(random, hard), b = shape_of(random, hard);
    geoms.add(a, 0, in_place), geoms.add(b, 1, in_place);
    Way way(random, 1.5, hard);
    if (hard && random() % 3 == 0) {
      const double strange[] = {std::nan(""), std::numeric_limits<double>::infinity(), 1e300};
      (random() % 2 ? way.xpos[random() % 2][random() % 6]
                    : way.xmat[random() % 2][random() % 18]) = strange[random() % 3];
    }
    RigidPairs pairs({{0, 1, random() % 2 ? 0.0 : 0.05}});
    std::vector<Row> rows, again;
    pairs.find(geoms, way.poses(), &rows);
    pairs.find(geoms, way.poses(), &again);
    check(rows.size() == again.size(), "the same step twice gives other rows");
    if (hard) continue;
    const bool touched = !rows.empty() && rows[0].distance < 1e-7;
    check(!touch_before(geoms, touched ? rows[0].t : 1), "a touch that is found late");
    if (a.kind == Kind::points && b.kind == Kind::points) {
      const double t = balls(way, a.radius + b.radius);
      check(touched ? std::fabs(rows[0].t - t) < 1e-6 : t > 1 - 1e-9, "balls at another time");
    }
  }
  return 100 * rounds;
}

// Simplices of a flex against a shape and against one another.
int simplices(Random& random, int rounds) {
  for (int round = 0; round < 20 * rounds; ++round) {
    const bool hard = round % 2;
    constexpr int vertices = 12, count = 30;
    const int corners = 2 + int(random() % 3);
    std::vector<double> x_t0(3 * vertices), x_t1(3 * vertices);
    for (auto* x : {&x_t0, &x_t1})
      for (double& v : *x) v = hard ? hard_number(random) : uniform(random, -1, 1);
    if (hard && random() % 4 == 0) x_t1[random() % x_t1.size()] = std::nan("");
    std::vector<std::int32_t> elements(corners * count);
    for (auto& e : elements) e = std::int32_t(random() % vertices);
    Geoms geoms;
    geoms.add(shape_of(random, hard), 0, in_place);
    geoms.add(shape_of(random, hard), 1, in_place);
    const Way way(random, 1, hard);
    const std::vector<std::uint8_t> skip(count, 0);
    std::vector<Row> rows;
    const std::size_t used = random() % (count + 1);  // none, too
    find_flex(geoms, way.poses(), x_t0.data(), x_t1.data(), elements.data(), used, corners, 0.01,
              {{0, 0.02, skip.data()}, {1, 0.0, skip.data()}}, &rows);
    for (const Row& row : rows)
      check(row.feature >= 0 && std::size_t(row.feature) < used, "a simplex that is not there");
    for (int k = 0; k + 1 < count; ++k) {
      Touch touch;
      simplices_touch(x_t0.data(), x_t1.data(), &elements[corners * k],
                      &elements[corners * (k + 1)], corners, 0.02, &touch);
    }
  }
  return 20 * rounds * 30;
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  const tauguard::geometry::RoundToNearest guard;
  Random random(4);
  const Tally tally = scenes(random, 2 * effort);
  const int pairs = shapes(random, effort), flexes = simplices(random, effort);
  std::printf("guarded steps %d (%d rolled back), shapes %d, simplices %d: %d wrong\n", tally.steps,
              tally.rolled_back, pairs, flexes, failures);
  return failures != 0;
}
