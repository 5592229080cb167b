// Plants without an interpreter, for the sanitizers: an arm between a hand, a table and a person,
// under every control mode, with absurd actions, tables, forces and snapshots; stepped one by one
// and from several threads. Prints what it tried.
#include "plant.hpp"

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <memory>
#include <thread>

#include "hard_numbers.hpp"
#include "mujoco_scene.hpp"

namespace {

using namespace tauguard::envs;

constexpr int arm_joints = 3, substeps = 4, reach_rows = 3, walk_rows = 2;
constexpr double timestep = 2e-3;

std::string sensor(const std::string& body) {
  return "<contact name=\"on_" + body + "\" body1=\"" + body +
         "\" data=\"found force torque pos\" reduce=\"netforce\" num=\"1\"/>";
}

// Three links, a hand on a slide, a table; a person's frames.
std::string mjcf() {
  std::string arm, people, sensors;
  for (int k = 0; k < arm_joints; ++k) {
    const std::string n = std::to_string(k + 1);
    arm += "<body name=\"link" + n + "\" pos=\"0 0 " + (k ? "0.3" : "0.2") +
           "\"><joint name=\"joint" + n + "\" axis=\"" + (k ? "0 1 0" : "0 0 1") +
           "\" range=\"-3 3\" armature=\"0.1\"/><geom type=\"capsule\" size=\"0.04\" "
           "fromto=\"0 0 0 0 0 0.3\" mass=\"2\" contype=\"1\" conaffinity=\"2\"/>";
    sensors += sensor("link" + n);
  }
  arm += "<site name=\"tool\" pos=\"0 0 0.3\"/></body></body></body>";
  for (int k = 0; k < person_segments; ++k) {
    const std::string n = std::to_string(k);
    people += "<body name=\"frame" + n + "\" mocap=\"true\"><geom name=\"part" + n +
              "\" type=\"capsule\" size=\"0.05 0.1\" contype=\"2\" conaffinity=\"1\"/></body>";
    sensors += sensor("frame" + n);
  }
  return "<mujoco><option timestep=\"0.002\"><flag autoreset=\"disable\"/></option><worldbody>"
         "<geom name=\"table\" type=\"box\" size=\"1 1 0.01\" contype=\"2\" conaffinity=\"1\"/>" +
         arm +
         "<body name=\"hand\" pos=\"0.3 0 0.5\"><joint name=\"slide\" type=\"slide\" axis=\"0 1 "
         "0\"/>"
         "<geom type=\"sphere\" size=\"0.05\" mass=\"0.6\" contype=\"2\" "
         "conaffinity=\"1\"/></body>" +
         people + "</worldbody><sensor>" + sensors + sensor("hand") + "</sensor></mujoco>";
}

// A plant with everything that Python would hold for it.
struct Cell {
  Cell(Mode mode, std::uint64_t seed, bool alone = false);

  std::vector<double>& row(std::size_t size) {
    kept.emplace_back(new std::vector<double>(size, 0.0));
    return *kept.back();
  }
  Held array(std::initializer_list<std::size_t> shape) {
    std::size_t size = 1;
    for (const std::size_t extent : shape) size *= extent;
    return {row(size).data(), shape};
  }

  Scene scene;
  std::vector<std::unique_ptr<std::vector<double>>> kept;
  Rows rows;
  std::size_t observed = 0;
  std::unique_ptr<Plant> plant;
};

Engine engine_of(const Scene& scene) {
  Engine e;
  const mjData* d = scene.data;
  e.model = scene.model, e.data = scene.data;
  e.step = reinterpret_cast<Engine::Function>(&mj_step);
  e.kinematics = reinterpret_cast<Engine::Function>(&mj_kinematics);
  e.distance = reinterpret_cast<Engine::Distance>(&mj_geomDistance);
  e.geom_xpos = d->geom_xpos, e.geom_xmat = d->geom_xmat, e.geom_rbound = scene.model->geom_rbound;
  e.nq = scene.model->nq, e.nv = scene.model->nv;
  e.qpos = d->qpos, e.qvel = d->qvel, e.qfrc_applied = d->qfrc_applied;
  e.xfrc_applied = d->xfrc_applied, e.sensordata = d->sensordata, e.site_xpos = d->site_xpos;
  e.xpos = d->xpos, e.xquat = d->xquat, e.xmat = d->xmat, e.xanchor = d->xanchor;
  e.xaxis = d->xaxis, e.mocap_pos = d->mocap_pos, e.mocap_quat = d->mocap_quat;
  return e;
}

std::vector<Joint> drives(const Scene& scene) {
  std::vector<Joint> out;
  for (int k = 0; k < arm_joints; ++k) {
    Joint j;
    const int id = scene.id(mjOBJ_JOINT, "joint" + std::to_string(k + 1));
    j.qpos = scene.model->jnt_qposadr[id], j.dof = scene.model->jnt_dofadr[id];
    j.gain = 10, j.nominal_gain = 9.5, j.current_limit = 8, j.gear = 100;
    j.coulomb = 2, j.breakaway = 3, j.stribeck_velocity = 0.1, j.viscous = 4;
    j.bristle_stiffness = k ? 5e3 : 0, j.load = 0.01, j.kp = 800, j.kd = 40;
    j.rated_speed = 2, j.no_load_speed = k == 2 ? 4 : 0, j.known_coulomb = 2, j.known_viscous = 4;
    j.cycles = {1, 2}, j.amplitude = {0.05, 0.02}, j.phase = {0, 1};
    out.push_back(j);
  }
  return out;
}

Region region(const Scene& scene, const std::string& body, int mocap) {
  Region r;
  r.body = scene.id(mjOBJ_BODY, body), r.mocap = mocap;
  if (mocap < 0) {
    r.joint = scene.id(mjOBJ_JOINT, "slide");
    r.qpos = scene.model->jnt_qposadr[r.joint], r.dof = scene.model->jnt_dofadr[r.joint];
    r.span = 0.3, r.speed = 1;
  }
  r.held = mocap >= 0;
  r.sensor = scene.model->sensor_adr[scene.id(mjOBJ_SENSOR, "on_" + body)];
  r.stiffness = 1e5, r.quasi_static = 100, r.transient = mocap % 2 ? 0 : 200;
  return r;
}

Surroundings around(const Scene& scene) {
  Surroundings s;
  s.arms.gravity = {0, 0, -9.81};
  for (int k = 0; k < arm_joints; ++k) {
    const std::string n = std::to_string(k + 1);
    s.arms.links.push_back({scene.id(mjOBJ_JOINT, "joint" + n),
                            scene.id(mjOBJ_BODY, "link" + n),
                            0,
                            false,
                            2,
                            {0, 0, 0.15}});
  }
  s.tools.push_back({scene.id(mjOBJ_SITE, "tool"), -1, 0});
  s.regions.push_back(region(scene, "hand", -1));
  s.people_begin = 1;
  for (int k = 0; k < person_segments; ++k) {
    const std::string name = "frame" + std::to_string(k);
    s.regions.push_back(region(scene, name, scene.model->body_mocapid[scene.id(mjOBJ_BODY, name)]));
  }
  s.people.emplace_back(Anatomy{0.9,  0.5, 0.22, 0.1, 0.09, 0.22, 0.32, 0.25,  0.18,  0.09, 0.42,
                                0.42, 0.0, M_PI, 1.0, 0.8,  0.2,  0.3,  false, false, true});
  for (int k = 0; k < person_segments; ++k)
    s.people_geoms.push_back(scene.id(mjOBJ_GEOM, "part" + std::to_string(k)));
  s.barriers.all.push_back({scene.id(mjOBJ_GEOM, "table"), {0, 0, 0}, {1, 1, 0.01}});
  s.sensor_begin = scene.model->sensor_adr[scene.id(mjOBJ_SENSOR, "on_link1")];
  return s;
}

Controls controls(Mode mode) {
  Controls c;
  c.mode = mode, c.period = substeps * timestep;
  c.scale.assign(mode == Mode::cartesian ? 6 : arm_joints, mode == Mode::cartesian ? 0.02 : 1.5);
  c.centre.assign(arm_joints, 0.2);
  c.max_speed.assign(arm_joints, 3.0), c.torque_limit.assign(arm_joints, 80.0);
  c.low.assign(arm_joints, -3.0), c.high.assign(arm_joints, 3.0);
  c.override_speed.assign(arm_joints, 0.0);
  return c;
}

Cell::Cell(Mode mode, std::uint64_t seed, bool alone) : scene(mjcf()) {
  Random random(seed);
  Surroundings s = around(scene);
  const std::size_t n = arm_joints, regions = s.regions.size();
  observed = 3 * n + 6 + 6 * regions;
  s.low.assign(observed, -50.0), s.high.assign(observed, 50.0);
  rows.observation = array({observed}), rows.metrics = array({metrics_width}),
  rows.tau_ext = array({n});
  rows.target = array({3}), rows.q = array({substeps, n}), rows.qd = array({substeps, n});
  rows.current = array({substeps, n}), rows.tau = array({substeps, n});
  rows.contact = array({substeps, contact_width}), rows.region = array({substeps, regions, 7});
  rows.tau_peak = array({n});
  rows.touched = {array({regions}), array({regions}), array({regions, 3}), array({regions, 3})};
  rows.reaches = array({2, reach_rows, reach_width}), rows.walks = array({walk_rows, walk_width});
  for (int k = 0; k < 2 * reach_rows; ++k) {
    double* r = rows.reaches.data() + reach_width * k;
    r[0] = 0.2, r[1] = 0.4, r[2] = 0.1 * double(random() % 5) - 0.2, r[3] = 0.7, r[4] = 0.1;
  }
  for (int k = 0; k < walk_rows; ++k) {
    double* w = rows.walks.data() + walk_width * k;
    w[0] = 0.5, w[1] = 0.8 + 0.4 * k, w[2] = 0.1;
  }
  plant.reset(new Plant(Physics(engine_of(scene)), {drives(scene), {}, timestep, 0.3}));
  if (alone) return;
  plant->controls = controls(mode);
  plant->substeps = substeps;
  plant->surround(std::move(s), rows);
  mj_forward(scene.model, scene.data);
  plant->reset();
}

// An action of the kinds that a policy may send; Python lets finite ones pass.
double action(Random& random) {
  const double hard[] = {1e300, -1e300, 5e-324, 0.0, -0.0, 1.0, -1.0};
  return random() % 3 ? double(random() % 2001) / 1000 - 1 : hard[random() % 7];
}

bool same(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && !std::memcmp(a.data(), b.data(), 8 * a.size());
}

std::vector<double> seen(const Cell& cell) {
  std::vector<double> out = cell.plant->state();
  for (const Held* h :
       {&cell.rows.observation, &cell.rows.metrics, &cell.rows.tau, &cell.rows.touched.force,
        &cell.rows.touched.direction, &cell.rows.contact, &cell.rows.current})
    out.insert(out.end(), h->data(), h->data() + h->size());
  out.insert(out.end(), cell.scene.data->qpos, cell.scene.data->qpos + cell.scene.model->nq);
  return out;
}

void check_rows(const Cell& cell) {
  for (std::size_t k = 0; k < cell.observed; ++k) {
    const double x = cell.rows.observation.data()[k];
    check(x >= -50 && x <= 50, "an observation out of its bounds");
  }
  for (std::size_t k = 0; k < metrics_width; ++k)
    check(std::isfinite(cell.rows.metrics.data()[k]), "a metric that is no number");
  const Metrics& m = cell.rows.result();
  check(m.cost >= 0 && m.force >= 0 && m.limit_ratio >= 0, "a force below 0");
  check(m.link >= 0 && m.link <= arm_joints, "a link that is not there");
  for (std::size_t k = 0; k < cell.rows.current.size(); ++k)
    check(std::fabs(cell.rows.current.data()[k]) <= 8 * (1 + 1e-12), "a current over its limit");
}

// Every mode, twice: one action at a time, and three plants from three threads. The same bits.
int actions(Random& random, int rounds) {
  int tried = 0;
  for (int m = 0; m < static_cast<int>(Mode::table); ++m) {
    const std::uint64_t seed = random();
    const Mode mode = static_cast<Mode>(m);
    std::vector<std::unique_ptr<Cell>> cells;
    for (int k = 0; k < 4; ++k) cells.emplace_back(new Cell(mode, seed));
    const auto play = [&](Cell& cell) {
      Random own(seed);
      for (int round = 0; round < 10 * rounds; ++round) {
        double row[6];
        for (double& a : row) a = action(own);
        if (own() % 10 == 0) cell.plant->aim({0.3, 0.1, 0.6}, 0.2);
        if (own() % 20 == 0) cell.plant->controls.override = static_cast<Override>(own() % 4);
        cell.plant->step(row);
        check_rows(cell);
        if (cell.rows.result().diverged != 0) {
          mj_resetData(cell.scene.model, cell.scene.data);
          mj_forward(cell.scene.model, cell.scene.data);
          cell.plant->reset();
        }
      }
    };
    std::vector<std::thread> threads;
    for (int k = 1; k < 4; ++k) threads.emplace_back([&, k] { play(*cells[k]); });
    for (auto& thread : threads) thread.join();
    play(*cells[0]);
    for (int k = 1; k < 4; ++k)
      check(same(seen(*cells[0]), seen(*cells[k])), "threads change bits");
    tried += 40 * rounds;
  }
  return tried;
}

// The drive's torque once more, plainly: a table of references on an arm that nothing touches.
int tables(Random& random, int rounds) {
  for (int round = 0; round < rounds; ++round) {
    Cell cell(Mode::table, 1, true), plain(Mode::table, 1, true);
    constexpr std::size_t n = arm_joints, length = 50;
    std::vector<double> q(n * length), qd(q.size()), feed(q.size()), push(6 * length);
    const bool hard = round % 2;
    for (std::size_t k = 0; k < q.size(); ++k) {
      q[k] = hard ? hard_number(random) : 0.1 * std::sin(0.01 * double(k));
      qd[k] = hard ? hard_number(random) : 0, feed[k] = hard ? hard_number(random) : 1;
    }
    if (round % 4 == 3) feed[n * (random() % length)] = std::nan("");
    if (round % 8 == 5) push[6 * (random() % length)] = 1e300;
    Track track;
    track.q = cell.array({length, n}), track.qd = cell.array({length, n});
    track.current = cell.array({length, n}), track.sensors = cell.array({length, 10});
    track.poses = cell.array({length, 2, 7}), track.bodies = {1, 2};
    track.wrench = push.data(), track.wrench_body = 2;
    const std::size_t done =
        cell.plant->follow({q.data(), qd.data(), feed.data(), n}, length, track);
    check(hard || done == length, "a quiet table diverges");
    DriveTrain train{drives(plain.scene), {}, timestep, 0.3};
    train.relax();
    double* pushed = plain.scene.data->xfrc_applied + 12;
    for (std::size_t t = 0; t < done; ++t) {
      std::copy_n(&push[6 * t], 6, pushed);
      for (std::size_t i = 0; i < n; ++i) {
        const Joint& j = train.joints[i];
        const double at = plain.scene.data->qpos[j.qpos], speed = plain.scene.data->qvel[j.dof];
        check(track.q.data()[n * t + i] == at, "follow is at another place than plain steps");
        const double torque =
            feed[n * t + i] + j.kp * (q[n * t + i] - at) + j.kd * (qd[n * t + i] - speed);
        plain.scene.data->qfrc_applied[j.dof] = train.apply(i, torque, at, speed);
      }
      mj_step(plain.scene.model, plain.scene.data);
    }
  }
  return rounds * 50;
}

// Snapshots: what was saved goes on with the same bits; what no plant gave is refused, and what is
// not refused is stepped without harm.
int snapshots(Random& random, int rounds) {
  Cell cell(Mode::velocity, 7), other(Mode::velocity, 7);
  const double strange[] = {std::nan(""), std::numeric_limits<double>::infinity(),
                            1e300,        -1e300,
                            -1.0,         0.5,
                            2147483648.0, 1e19,
                            5e-324,       3.0};
  for (int round = 0; round < 50 * rounds; ++round) {
    double row[6];
    for (double& a : row) a = action(random);
    std::vector<double> saved = cell.plant->state();
    check(other.plant->restore(saved), "a plant's own state is refused");
    check(same(other.plant->state(), saved), "a restored state is another");
    for (int k = 0; k < 1 + int(random() % 3); ++k)
      saved[random() % saved.size()] = strange[random() % 10];
    if (random() % 20 == 0) saved.pop_back();
    const std::vector<double> before = other.plant->state();
    if (!other.plant->restore(saved))
      check(same(other.plant->state(), before), "a refused state has changed the plant");
    other.plant->step(row);
    cell.plant->step(row);
    for (Cell* c : {&cell, &other})
      if (c->rows.result().diverged != 0 || c == &other) {
        mj_resetData(c->scene.model, c->scene.data);
        mj_forward(c->scene.model, c->scene.data);
        c->plant->reset();
      }
  }
  return 50 * rounds;
}

}  // namespace

int main(int argc, char** argv) {
  const int effort = argc > 1 ? std::atoi(argv[1]) : 20;
  Random random(3);
  const int acted = actions(random, effort), rows = tables(random, effort),
            restored = snapshots(random, effort);
  std::printf("actions %d, table rows %d, snapshots %d: %d wrong\n", acted, rows, restored,
              failures);
  return failures != 0;
}
