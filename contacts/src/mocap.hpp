// Mocap bodies, which the user moves by setting poses, and all bodies attached to them.
//
// MuJoCo sets the new pose at the start of a step, without a velocity. Here mocap bodies move
// during the step, from their pose at the end of the last step to the commanded one, on a straight
// line and with a constant rotation rate.
#pragma once

#include "engine.hpp"
#include "partners.hpp"
#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::contacts {

using namespace rigid;  // the convex kernel

class Mocap {
 public:
  // `pulled`: for each equality constraint, whether it acts on a body attached to a mocap body.
  Mocap(const Engine& engine, std::vector<char> pulled);

  void set_pulled(std::vector<char> pulled) { pulled_ = std::move(pulled); }
  // Whether all poses are finite.
  bool finite() const;
  template <class Archive>
  void archive(Archive& a) {
    a(start_), a(time_);
  }

  // Stores the present poses as the start of the motion in the next step.
  void remember();
  // Begins a step at the present state. False if the user changed the state since the last step.
  bool begin();
  bool moves() const { return moves_; }  // whether some mocap body moves in this step

  // Sets the part of the motion in the next attempt: `from` and `to` are fractions of the step. The
  // data must be at the start of this part.
  void sub_step(double from, double to);
  // Write poses to the data: of the sub-step's start, of its end, or as commanded by the user.
  void depart() { write(from_); }
  void arrive() { write(to_); }
  void command() { write(commanded_); }

  // Poses at the start. In a whole step they are in `other`, because the data has the poses of the
  // end.
  const double* xpos() const { return jumps() ? e_.other_xpos : e_.xpos; }
  const double* xmat() const { return jumps() ? e_.other_xmat : e_.xmat; }
  const double* flexvert() const { return jumps() ? e_.other_flexvert_xpos : e_.flexvert_xpos; }
  // Adds, for each body (nbody, 3), the rotation of the mocap body that it is attached to [rad].
  void add_turns(double* turn) const;

  // For a sub-step: computes the potential energy [J] and the vertices for the joint positions of
  // the start and the mocap poses of the end. False if no mocap body moves, or in a whole step.
  bool shifted();
  double potential() const { return e_.other_energy[0]; }
  const double* vertices() const { return e_.other_flexvert_xpos; }

  // Whether some mocap body moves and one of the partners is a geom attached to a mocap body.
  bool carries(const Partners& pair) const;
  // The distance by which mocap bodies separate the partners along the contact's normal [m].
  double separation(const Contact& contact) const;
  // The displacement of a point that moves with the mocap body to which `body` is attached, and the
  // rotation vector of this body [rad]. The point is given in the present kinematics of the data,
  // which are those of the start of a sub-step or of the end of a whole step.
  Vec3 displacement(int body, const double* point) const;
  Vec3 turn(int body) const;
  // Work of mocap bodies on all others, by contacts and equality constraints [J]. `velocity` is the
  // mean velocity of the sub-step.
  double work(const double* velocity, double length);

 private:
  struct Pose {
    double pos[3], quat[4];
  };
  using Poses = std::vector<Pose>;  // indexed by mocap number

  bool jumps() const { return moves_ && jumps_; }
  void read(Poses* poses) const;
  void write(const Poses& poses);
  void place_other(const Poses& poses);

  const Engine& e_;
  std::vector<char> pulled_;
  Poses start_, commanded_, from_, to_;
  std::vector<double> speed_;
  double time_ = 0;
  bool moves_ = false, jumps_ = true;
};

}  // namespace tauguard::contacts
