// A random scene under a guarded stepper, wired as contacts/guard does it, but by MuJoCo's headers:
// convex geoms that fly at a floor and one another, a mocap paddle, sometimes a cloth.
#pragma once

#include <array>
#include <memory>

#include "hard_numbers.hpp"
#include "mujoco_scene.hpp"
#include "stepper.hpp"

namespace guarded {

using namespace tauguard::contacts;

constexpr double levels[] = {0, 0.5, 0.75, 0.95};
constexpr int geom_kinds[] = {mjGEOM_PLANE,     mjGEOM_SPHERE,   mjGEOM_CAPSULE,
                              mjGEOM_ELLIPSOID, mjGEOM_CYLINDER, mjGEOM_BOX};

inline double uniform(Random& random, double low, double high) {
  return low + (high - low) * double(random() % 100001) / 100000;
}

inline std::string body(Random& random, int number) {
  const char* kinds[] = {"sphere", "capsule", "ellipsoid", "cylinder", "box"};
  char text[400];
  const auto size = [&] { return uniform(random, 0.01, 0.1); };
  std::snprintf(text, sizeof text,
                "<body pos=\"%g %g %g\"><freejoint/><geom type=\"%s\" size=\"%g %g %g\"/></body>",
                uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3), 0.2 + 0.25 * number,
                kinds[random() % 5], size(), size(), size());
  return text;
}

inline std::string mjcf(Random& random, bool cloth, bool reset) {
  const char* integrators[] = {"Euler", "discrete", "implicitfast"};  // the last has no cloth
  const char* steps[] = {"0.001", "0.004", "0.01"};
  std::string text = "<mujoco><option timestep=\"" + std::string(steps[random() % 3]) +
                     "\" integrator=\"" + integrators[random() % (cloth ? 2 : 3)] +
                     "\"><flag autoreset=\"" + (reset ? "enable" : "disable") +
                     "\"/></option><worldbody><geom type=\"plane\" size=\"5 5 1\"/>";
  const int bodies = 2 + int(random() % 4);
  for (int k = 0; k < bodies; ++k) text += body(random, k);
  text +=
      "<body name=\"paddle\" mocap=\"true\" pos=\"0 0 -.5\"><geom type=\"box\" size=\".1 .1 .01\"/>"
      "</body>";
  if (cloth)
    text +=
        "<flexcomp name=\"cloth\" type=\"grid\" dim=\"2\" count=\"3 3 1\" spacing=\".15 .15 .15\" "
        "pos=\"0 0 1.5\" radius=\".005\" mass=\".2\"><contact selfcollide=\"none\"/>"
        "<elasticity young=\"3e4\" poisson=\"0\" thickness=\"5e-3\" elastic2d=\"stretch\"/>"
        "</flexcomp>";
  return text + "</worldbody></mujoco>";
}

inline Engine engine_of(const Scene& scene, mjData* end, mjData* other) {
  mjModel* m = scene.model;
  mjData* d = scene.data;
  Engine e{};
  e.model = m, e.data = d, e.end = end, e.other = other;
  const auto step = [](void (*f)(const mjModel*, mjData*)) {
    return reinterpret_cast<Engine::Step>(f);
  };
  e.step = step(&mj_step), e.step1 = step(&mj_step1), e.step2 = step(&mj_step2);
  e.kinematics = step(&mj_kinematics), e.com_pos = step(&mj_comPos), e.com_vel = step(&mj_comVel);
  e.flex = step(&mj_flex), e.tendon = step(&mj_tendon), e.make_m = step(&mj_makeM);
  e.energy_pos = step(&mj_energyPos);
  e.get_state = reinterpret_cast<decltype(e.get_state)::Function>(&mj_getState);
  e.set_state = reinterpret_cast<decltype(e.set_state)::Function>(&mj_setState);
  e.copy_state = reinterpret_cast<decltype(e.copy_state)::Function>(&mj_copyState);
  e.copy_model = reinterpret_cast<decltype(e.copy_model)::Function>(&mj_copyModel);
  e.mul_jac_t = reinterpret_cast<decltype(e.mul_jac_t)::Function>(&mj_mulJacTVec);
  e.mul_m = reinterpret_cast<decltype(e.mul_m)::Function>(&mj_mulM);
  e.jac_com = reinterpret_cast<decltype(e.jac_com)::Function>(&mj_jacBodyCom);
  e.mul_jac = reinterpret_cast<decltype(e.mul_jac)::Function>(&mj_mulJacVec);
  e.jac = reinterpret_cast<decltype(e.jac)::Function>(&mj_jac);
  e.solve_m = reinterpret_cast<decltype(e.solve_m)::Function>(&mj_solveM);
  e.integrate = reinterpret_cast<decltype(e.integrate)::Function>(&mj_integratePos);
  e.nq = m->nq, e.nv = m->nv, e.nbody = m->nbody, e.ngeom = m->ngeom, e.nflex = m->nflex;
  e.nmocap = m->nmocap, e.geom_bodyid = m->geom_bodyid, e.body_rootid = m->body_rootid;
  e.body_mocapid = m->body_mocapid, e.mocap_pos = d->mocap_pos, e.mocap_quat = d->mocap_quat;
  e.body_dofnum = m->body_dofnum, e.body_weldid = m->body_weldid;
  e.nflexvert = m->nflexvert, e.ntendon = m->ntendon;
  e.signature = {mjSTATE_INTEGRATION, mjSTATE_QPOS | mjSTATE_MOCAP_POS | mjSTATE_MOCAP_QUAT};
  e.state_size = mj_stateSize(m, mjSTATE_INTEGRATION);
  e.timestep = &m->opt.timestep, e.disableflags = &m->opt.disableflags;
  e.enableflags = &m->opt.enableflags, e.o_margin = &m->opt.o_margin;
  e.o_solref = m->opt.o_solref, e.o_solimp = m->opt.o_solimp, e.override_flag = mjENBL_OVERRIDE;
  e.integrator = &m->opt.integrator, e.cone = &m->opt.cone, e.solver = &m->opt.solver;
  e.iterations = &m->opt.iterations;
  e.surfaces_move = &m->flg_surfacevel, e.model_size = sizeof(mjModel);
  const std::size_t at[5][3] = {
      {offsetof(mjModel, pair_margin), offsetof(mjModel, geom_margin),
       offsetof(mjModel, flex_margin)},
      {offsetof(mjModel, pair_solref), offsetof(mjModel, geom_solref),
       offsetof(mjModel, flex_solref)},
      {offsetof(mjModel, pair_solimp), offsetof(mjModel, geom_solimp),
       offsetof(mjModel, flex_solimp)},
      {offsetof(mjModel, pair_friction), offsetof(mjModel, geom_friction),
       offsetof(mjModel, flex_friction)},
      {0, offsetof(mjModel, geom_priority), offsetof(mjModel, flex_priority)}};
  for (int k = 0; k < 3; ++k)
    e.at_margin[k] = at[0][k], e.at_solref[k] = at[1][k], e.at_solimp[k] = at[2][k],
    e.at_friction[k] = at[3][k], e.at_priority[k] = at[4][k];
  e.npair = m->npair;
  e.pair_geom1 = m->pair_geom1, e.pair_geom2 = m->pair_geom2;
  e.flex_vertbodyid = m->flex_vertbodyid, e.flex_vert = m->flex_vert;
  e.time = &d->time, e.qpos = d->qpos, e.qvel = d->qvel, e.energy = d->energy;
  e.qfrc_actuator = d->qfrc_actuator, e.qfrc_applied = d->qfrc_applied;
  e.xfrc_applied = d->xfrc_applied, e.xipos = d->xipos;
  e.xpos = d->xpos, e.xmat = d->xmat, e.flexvert_xpos = d->flexvert_xpos;
  e.ncon = &d->ncon, e.nefc = &d->nefc;
  e.contact = reinterpret_cast<char* const*>(&d->contact), e.contact_size = sizeof(mjContact);
  e.at_dist = offsetof(mjContact, dist), e.at_dim = offsetof(mjContact, dim);
  e.at_geom = offsetof(mjContact, geom), e.at_flex = offsetof(mjContact, flex);
  e.at_efc_address = offsetof(mjContact, efc_address);
  e.efc_aref = &d->efc_aref, e.efc_margin = &d->efc_margin;
  e.at_pos = offsetof(mjContact, pos), e.at_frame = offsetof(mjContact, frame);
  e.efc_vel = &d->efc_vel, e.efc_pos = &d->efc_pos, e.efc_force = &d->efc_force;
  e.at_friction_of = offsetof(mjContact, friction);
  e.at_surfacevel = offsetof(mjContact, surfacevel);
  e.efc_diagA = &d->efc_diagA;
  e.efc_type = &d->efc_type, e.efc_id = &d->efc_id;
  e.full[0] = &d->warning[mjWARN_CONTACTFULL].number;
  e.full[1] = &d->warning[mjWARN_CNSTRFULL].number;
  e.end_qvel = end->qvel, e.end_energy = end->energy, e.end_xpos = end->xpos;
  e.end_xmat = end->xmat, e.end_flexvert_xpos = end->flexvert_xpos, e.end_cvel = end->cvel;
  e.other_energy = other->energy, e.other_xpos = other->xpos, e.other_xmat = other->xmat;
  e.other_mocap_pos = other->mocap_pos, e.other_mocap_quat = other->mocap_quat;
  e.other_flexvert_xpos = other->flexvert_xpos;
  e.discrete = mjINT_DISCRETE, e.pyramidal = mjCONE_PYRAMIDAL;
  e.elliptic = mjCONE_ELLIPTIC;
  e.refsafe = mjDSBL_REFSAFE, e.newton = mjSOL_NEWTON, e.equality = mjCNSTR_EQUALITY;
  return e;
}

inline Kind kind_of(int type) {
  constexpr Kind kinds[] = {Kind::half_spaces, Kind::points,    Kind::segments,
                            Kind::ellipsoids,  Kind::cylinders, Kind::boxes};
  int k = 0;
  while (geom_kinds[k] != type) ++k;
  return kinds[k];
}

inline double thickness(const mjModel* m, int geom) {
  const double* size = m->geom_size + 3 * geom;
  switch (m->geom_type[geom]) {
    case mjGEOM_PLANE:
      return 0;
    case mjGEOM_SPHERE:
    case mjGEOM_CAPSULE:
      return size[0];
    case mjGEOM_CYLINDER:
      return std::min(size[0], size[1]);
    default:
      return std::min({size[0], size[1], size[2]});
  }
}

inline int add_shape(const mjModel* m, int geom, double layer, Verdict* verdict) {
  Shape shape{kind_of(m->geom_type[geom]), {}, 0, {}, {}, {}, {}, {}};
  const bool round = m->geom_type[geom] == mjGEOM_SPHERE || m->geom_type[geom] == mjGEOM_CAPSULE;
  for (int k = 0; k < 3; ++k)
    shape.size[k] = std::max(m->geom_size[3 * geom + k] - (round ? 0 : layer), 0.0);
  if (round) shape.radius = m->geom_size[3 * geom] - layer;
  double mat[9];
  mju_quat2Mat(mat, m->geom_quat + 4 * geom);
  LocalFrame frame;
  for (int i = 0; i < 3; ++i)
    frame.row[i] = {mat[3 * i], mat[3 * i + 1], mat[3 * i + 2]},
    frame.at[i] = m->geom_pos[3 * geom + i];
  return verdict->add(std::move(shape), m->geom_bodyid[geom], frame);
}

struct Guarded {
  Guarded(std::uint64_t seed, bool cloth, bool reset) : random(seed), scene(text(cloth, reset)) {
    mjModel* m = scene.model;
    end = mj_makeData(m), other = mj_makeData(m);
    Verdict verdict;
    std::vector<Partners> pairs;
    std::vector<int> last, spins;
    for (int a = 0; a < m->ngeom; ++a)
      for (int b = a + 1; b < m->ngeom; ++b) {
        verdict.add_pair(cores(a, &verdict), cores(b, &verdict));
        pairs.push_back({{Place::geom, a}, {Place::geom, b}, {Place::geom, a}});
        last.push_back(3);
      }
    for (int geom = 0; cloth && geom < m->ngeom; ++geom) add_cloth(geom, &verdict, &pairs, &last);
    for (int j = 0; j < m->njnt; ++j)
      if (m->jnt_type[j] == mjJNT_FREE)
        for (int k = 3; k < 6; ++k) spins.push_back(m->jnt_dofadr[j] + k);
    const Settings settings{40, 1e-5, 1.25, 1.0 / 64, 10, 16, 1.0 / 8, 0.5, 1.0, 0.01};
    Coverage covered{
        std::move(verdict), std::move(pairs), std::move(last), {}, std::move(spins), {}};
    stepper.reset(new Stepper(engine_of(scene, end, other), std::move(covered), settings));
    mj_forward(m, scene.data);
  }
  ~Guarded() { mj_deleteData(end), mj_deleteData(other); }

  std::string text(bool cloth, bool reset) { return mjcf(random, cloth, reset); }

  std::vector<std::int32_t> cores(int geom, Verdict* verdict) const {
    std::vector<std::int32_t> out;
    for (const double level : levels)
      out.push_back(add_shape(scene.model, geom, level * thickness(scene.model, geom), verdict));
    return out;
  }

  void add_cloth(int geom, Verdict* verdict, std::vector<Partners>* pairs, std::vector<int>* last) {
    const mjModel* m = scene.model;
    const double radius = m->flex_radius[0], thick = thickness(m, geom);
    const double layers[] = {0, 0.5 * std::min(thick, 4 * radius), 0.5 * thick, 0.75 * thick,
                             0.95 * thick};
    std::vector<std::int32_t> a;
    for (const double layer : layers) a.push_back(add_shape(m, geom, layer, verdict));
    std::vector<std::int32_t> elements(m->flex_elem, m->flex_elem + 3 * m->flex_elemnum[0]);
    verdict->add_flex_pair(std::move(a), {radius, radius / 2, radius / 2, radius / 4, radius / 20},
                           std::move(elements), 3,
                           std::vector<std::uint8_t>(m->flex_elemnum[0], 0));
    pairs->push_back({{Place::flex, 0}, {Place::geom, geom}, {Place::flex, 0}});
    last->push_back(4);
  }

  Random random;
  Scene scene;
  mjData *end, *other;
  std::unique_ptr<Stepper> stepper;
};

}  // namespace guarded
