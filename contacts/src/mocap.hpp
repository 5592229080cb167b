// Bodies that the user moves by mocap poses, and everything attached to them.
//
// MuJoCo sets their new pose at the start of a step, without a velocity. Here they move during the
// step: from their pose at the end of the last step to the commanded one, on a straight line and
// with a constant rotation rate.
#pragma once

#include "engine.hpp"
#include "stiffening.hpp"
#include "tauguard/rigid/support_shape.hpp"

namespace tauguard::contacts {

using namespace rigid;  // the convex kernel

class Mocap {
 public:
  // `pulled`: for each equality, whether a mocap body or something attached to one takes part in
  // it.
  Mocap(const Engine& engine, std::vector<char> pulled);

  void set_pulled(std::vector<char> pulled) { pulled_ = std::move(pulled); }
  // Whether all poses are finite.
  bool finite() const;
  template <class Archive>
  void archive(Archive& a) {
    a(start_), a(time_);
  }

  // Takes the present poses as the start of the next step's motion.
  void remember();
  // Begins a step at the present state. False if the state was changed from outside since the last
  // step.
  bool begin();
  bool moves() const { return moves_; }  // whether some mocap body moves in this step

  // Sets the fractions of the motion between which the next attempt runs. The data is at the
  // attempt's start.
  void sub_step(double from, double to);
  // Write the poses of a sub-step's start, of its end, and of the step's end as the user gave them.
  void depart() { write(from_); }
  void arrive() { write(to_); }
  void command() { write(commanded_); }

  // Positions at the start. Whole steps are computed with the poses of their end, so the data
  // itself does not have them.
  const double* xpos() const { return jumps() ? e_.other_xpos : e_.xpos; }
  const double* xmat() const { return jumps() ? e_.other_xmat : e_.xmat; }
  const double* flexvert() const { return jumps() ? e_.other_flexvert : e_.flexvert; }
  // Adds the rotation of each body that its mocap body causes (nbody, 3) [rad].
  void add_turns(double* turn) const;

  // For a sub-step: computes the potential energy of the start's joint positions with the end's
  // mocap poses [J], and the vertices. False if nothing moves or the data already has these poses.
  bool shifted();
  double potential() const { return e_.other_energy[0]; }
  const double* vertices() const { return e_.other_flexvert; }

  // Whether some mocap body moves and one of the partners is a geom attached to a mocap body.
  bool carries(const Partners& pair) const;
  // The distance by which mocap bodies separate the partners along the contact's normal [m].
  double parting(const Contact& contact) const;
  // Work that mocap bodies did on all others, by contacts and equalities [J]. `velocity` is the
  // mean velocity.
  double work(const double* velocity, double length);

 private:
  struct Pose {
    double pos[3], quat[4];
  };
  using Poses = std::vector<Pose>;  // indexed by mocap number

  bool jumps() const { return moves_ && jumps_; }
  void read(Poses* poses) const;
  void write(const Poses& poses);
  void stand(const Poses& poses);
  Vec3 way(int body, const double* point) const;

  const Engine& e_;
  std::vector<char> pulled_;
  Poses start_, commanded_, from_, to_;
  std::vector<double> speed_;
  double time_ = 0;
  bool moves_ = false, jumps_ = true;
};

}  // namespace tauguard::contacts
