// The parts of MuJoCo that the guard uses: functions, and fields of a model and its data, by
// address. Python finds them (contacts/guard/engine.py); MuJoCo's headers are not needed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <utility>
#include <vector>

#include "caught.hpp"
#include "tauguard/geometry/fields.hpp"

namespace tauguard::contacts {

// Bits of MuJoCo's mjtState: `integration` for all that determines a step, `pose` for kinematics.
struct Signatures {
  int integration, pose;
};

// A contact in MuJoCo's list.
struct Contact {
  double distance;
  int dim, row;  // condim; first constraint row, or -1
  int geom[2], flex[2];
  const double *at, *normal;  // point; unit vector from the first partner to the second
  const double* friction;     // coefficients: two of sliding, then of torsion and rolling
  double* surface;            // velocity of the second surface relative to the first (3)
};

struct Engine {
  using Step = void (*)(const void*, void*);
  const void* model;
  void *data, *end;  // the stepped data; data for the kinematics at the end of a step
  void* other;       // only with mocap bodies: data with the same joints and other mocap poses

  Logging logging;
  Call<const void*, void*> step, step1, step2, kinematics, com_pos, com_vel, flex, tendon, make_m,
      energy_pos;
  Call<const void*, const void*, double*, int> get_state;
  Call<const void*, void*, const double*, int> set_state;
  Call<const void*, const void*, void*, int> copy_state;
  Call<void*, const void*> copy_model;
  Call<const void*, const void*, double*, const double*> mul_m, mul_jac, mul_jac_t;
  Call<const void*, const void*, double*, double*, int> jac_com;
  Call<const void*, const void*, double*, double*, const double*, int> jac;
  Call<const void*, void*, double*, const double*, int> solve_m;
  Call<const void*, double*, const double*, double> integrate;

  int nq, nv, nbody, nmocap, ngeom, npair, nflex, nflexvert, ntendon;
  Signatures signature;
  int state_size;
  bool interpolated;  // whether some flex has vertices without their own bodies

  // Fields of the model, which are only read. Sub-steps change a copy (model_copy.hpp).
  const double* timestep;
  const int *disableflags, *enableflags, *integrator, *cone, *solver, *iterations;
  const double *o_margin, *o_solref, *o_solimp;  // for all contacts, if the flag `override` is set
  const bool* surfaces_move;                     // whether any geom has a surface velocity
  // The size of the struct, and the offsets of its arrays of contact parameters, by Place::Kind.
  std::size_t model_size, at_margin[3], at_solref[3], at_solimp[3], at_friction[3], at_priority[3];
  const int *pair_geom1, *pair_geom2;
  const int *flex_vertbodyid, *geom_bodyid, *body_rootid, *body_mocapid;
  const int *body_dofnum, *body_weldid;
  const double* flex_vert;

  // Fields of `data`.
  double *time, *qpos, *qvel, *energy, *mocap_pos, *mocap_quat;
  const double *qfrc_actuator, *qfrc_applied, *xfrc_applied;
  const double *xpos, *xmat, *xipos, *flexvert_xpos;
  const int *ncon, *nefc;
  char* const* contact;
  std::size_t contact_size, at_dist, at_dim, at_geom, at_flex, at_efc_address, at_pos, at_frame,
      at_friction_of, at_surfacevel;
  double *const *efc_aref, *const *efc_margin;
  double *const *efc_vel, *const *efc_pos, *const *efc_force, *const *efc_diagA;
  int *const *efc_type, *const *efc_id;

  int* resets[3];  // MuJoCo's counts of warnings of bad positions, velocities and accelerations
  int* full[2];    // and of too little memory for contacts and for constraints

  // Fields of `end`.
  double *end_qvel, *end_energy;
  const double *end_xpos, *end_xmat, *end_flexvert_xpos, *end_cvel;

  // Fields of `other`.
  double *other_energy, *other_mocap_pos, *other_mocap_quat;
  const double *other_xpos, *other_xmat, *other_flexvert_xpos;

  // Values of MuJoCo's enumerations, and refused flags.
  int discrete, runge_kutta, pyramidal, elliptic, refsafe, newton, equality, override_flag, refused;
  void* const* contact_filter;      // MuJoCo's global callback
  void* const* callbacks[7];        // all other global callbacks
  std::size_t at_pstack, at_pbase;  // offsets of mjData's pointers into its stack

  // The names in Python's dict of addresses and numbers.
  TAUGUARD_FIELDS(model, data, end, other, logging.set, logging.global, logging.error,
                  logging.at_subject, step, step1, step2, kinematics, com_pos, com_vel, flex,
                  tendon, make_m, energy_pos, get_state, set_state, copy_state, mul_m, mul_jac,
                  mul_jac_t, copy_model, jac_com, jac, solve_m, integrate, nq, nv, nbody, nmocap,
                  ngeom, npair, nflex, nflexvert, ntendon, signature.integration, signature.pose,
                  state_size, interpolated, timestep, disableflags, enableflags, integrator, cone,
                  solver, iterations, o_margin, o_solref, o_solimp, surfaces_move, model_size,
                  at_margin[0], at_margin[1], at_margin[2], at_solref[0], at_solref[1],
                  at_solref[2], at_solimp[0], at_solimp[1], at_solimp[2], at_friction[0],
                  at_friction[1], at_friction[2], at_priority[1], at_priority[2], pair_geom1,
                  pair_geom2, flex_vertbodyid, geom_bodyid, body_rootid, body_mocapid, body_dofnum,
                  body_weldid, flex_vert, time, qpos, qvel, energy, mocap_pos, mocap_quat,
                  qfrc_actuator, qfrc_applied, xfrc_applied, xpos, xmat, xipos, flexvert_xpos, ncon,
                  nefc, contact, contact_size, at_dist, at_dim, at_geom, at_flex, at_efc_address,
                  at_pos, at_frame, at_friction_of, at_surfacevel, efc_aref, efc_margin, efc_vel,
                  efc_pos, efc_force, efc_diagA, efc_type, efc_id, resets[0], resets[1], resets[2],
                  full[0], full[1], end_qvel, end_energy, end_xpos, end_xmat, end_flexvert_xpos,
                  end_cvel, other_energy, other_mocap_pos, other_mocap_quat, other_xpos, other_xmat,
                  other_flexvert_xpos, discrete, runge_kutta, pyramidal, elliptic, refsafe, newton,
                  equality, override_flag, refused, contact_filter, callbacks[0], callbacks[1],
                  callbacks[2], callbacks[3], callbacks[4], callbacks[5], callbacks[6], at_pstack,
                  at_pbase)

  Contact contact_at(int k) const {
    char* p = *contact + static_cast<std::size_t>(k) * contact_size;
    const int* geom_ids = reinterpret_cast<const int*>(p + at_geom);
    const int* flex_ids = reinterpret_cast<const int*>(p + at_flex);
    return {*reinterpret_cast<const double*>(p + at_dist),
            *reinterpret_cast<const int*>(p + at_dim),
            *reinterpret_cast<const int*>(p + at_efc_address),
            {geom_ids[0], geom_ids[1]},
            {flex_ids[0], flex_ids[1]},
            reinterpret_cast<const double*>(p + at_pos),
            reinterpret_cast<const double*>(p + at_frame),
            reinterpret_cast<const double*>(p + at_friction_of),
            reinterpret_cast<double*>(p + at_surfacevel)};
  }
  // The number of rows of a contact that act along its normal, counted from its first row.
  int normal_rows(const Contact& c) const {
    return *cone == pyramidal && c.dim > 1 ? 2 * (c.dim - 1) : 1;
  }
  bool has_callbacks() const {
    for (void* const* callback : callbacks)
      if (callback && *callback) return true;
    return false;
  }
  bool is_discrete() const { return *integrator == discrete; }
};

// MuJoCo's stack pointers, which an error does not reset.
class Stacks {
 public:
  explicit Stacks(const Engine& engine) : e_(engine) {
    for (int k = 0; k < 3; ++k)
      std::memcpy(&stack_[k], at(k, e_.at_pstack), sizeof stack_[k]),
          std::memcpy(&frames_[k], at(k, e_.at_pbase), sizeof frames_[k]);
  }
  void put_back() const {
    for (int k = 0; k < 3; ++k)
      std::memcpy(at(k, e_.at_pstack), &stack_[k], sizeof stack_[k]),
          std::memcpy(at(k, e_.at_pbase), &frames_[k], sizeof frames_[k]);
  }

 private:
  char* at(int k, std::size_t offset) const {
    void* const all[3] = {e_.data, e_.end, e_.other};
    return static_cast<char*>(all[k]) + offset;
  }
  const Engine& e_;
  std::size_t stack_[3], frames_[3];
};

// Detects whether MuJoCo resets the data while this object lives, because numbers are not finite or
// too large. At time 0 a reset does not change the time, so warnings are counted from 0. If no
// reset happened, the earlier counts are restored.
class ResetWatch {
 public:
  explicit ResetWatch(const Engine& engine) : e_(engine) {
    for (int k = 0; k < 3; ++k) before_[k] = std::exchange(*e_.resets[k], 0);
  }
  ~ResetWatch() {
    if (happened()) return;
    for (int k = 0; k < 3; ++k) *e_.resets[k] = before_[k];
  }
  bool happened() const { return *e_.resets[0] || *e_.resets[1] || *e_.resets[2]; }

 private:
  const Engine& e_;
  int before_[3];
};

}  // namespace tauguard::contacts
