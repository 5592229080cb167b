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
  // `pulled`: by equality, whether something that mocap carries takes part in it.
  Mocap(const Engine& engine, std::vector<char> pulled);

  void set_pulled(std::vector<char> pulled) { pulled_ = std::move(pulled); }
  // Whether every number of the poses is finite.
  bool finite() const;
  template <class Archive>
  void archive(Archive& a) {
    a(start_), a(time_);
  }

  // The present poses begin the way of the next step.
  void remember();
  // A step begins at the present state; false if something else set it since the last one ended.
  bool begin();
  bool moves() const { return moves_; }  // whether the way of this step has a length

  // The next attempt goes from one fraction of the motion to another; the data is at its start.
  void sub_step(double from, double to);
  // Poses of a sub-step's start, end, and of the step's end as the user wrote them.
  void depart() { write(from_); }
  void arrive() { write(to_); }
  void command() { write(commanded_); }

  // Where everything is at the start: whole steps are computed with the poses of their end.
  const double* xpos() const { return jumps() ? e_.other_xpos : e_.xpos; }
  const double* xmat() const { return jumps() ? e_.other_xmat : e_.xmat; }
  const double* flexvert() const { return jumps() ? e_.other_flexvert : e_.flexvert; }
  // Adds how far each body is turned by what carries it (nbody, 3) [rad].
  void add_turns(double* turn) const;

  // Of a sub-step: potential energy of the start's joint positions with the poses of its end [J],
  // and the vertices there. False if nothing moves or the data has these poses anyway.
  bool shifted();
  double potential() const { return e_.other_energy[0]; }
  const double* vertices() const { return e_.other_flexvert; }

  // Whether one of the partners is a geom that hangs on a mocap body, and some mocap body moves.
  bool carries(const Partners& pair) const;
  // How far the carriers separate both partners along the contact's normal [m].
  double parting(const Contact& contact) const;
  // What was done on everything else, by contacts and equalities; `velocity` is the mean [J].
  double work(const double* velocity, double length);

 private:
  struct Pose {
    double pos[3], quat[4];
  };
  using Poses = std::vector<Pose>;  // by mocap number

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
