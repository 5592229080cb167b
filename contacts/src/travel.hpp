// How far the partners of a contact can approach each other in one step, from above.
#pragma once

#include "sweep.hpp"

namespace tauguard::contacts {

class Travel {
 public:
  // `inner` and `flex_radius`: half the least thickness of each geom and flex.
  Travel(std::vector<std::int32_t> body_of_geom, std::vector<double> inner,
         std::vector<std::int32_t> vertex_begin, std::vector<std::int32_t> vertex_end,
         std::vector<double> flex_radius)
      : body_of_geom_(std::move(body_of_geom)),
        inner_(std::move(inner)),
        vertex_begin_(std::move(vertex_begin)),
        vertex_end_(std::move(vertex_end)),
        flex_radius_(std::move(flex_radius)) {}

  std::size_t geoms() const { return body_of_geom_.size(); }
  std::size_t flexes() const { return vertex_begin_.size(); }

  // Of each contact, how far both partners go in all (`way`), and the depth at which their middles
  // meet (`core`). A partner is a geom, or a flex where the geom is negative; `point` (count, 3) is
  // where they touch.
  void bound(const std::int32_t* geom, const std::int32_t* flex_of, const double* point,
             std::size_t count, const Poses& poses, const double* x_t0, const double* x_t1,
             double* way, double* core) const;

 private:
  double flex(int number, const double* x_t0, const double* x_t1) const;
  double rigid(int geom, const double* point, const Poses& poses) const;

  std::vector<std::int32_t> body_of_geom_;
  std::vector<double> inner_;
  std::vector<std::int32_t> vertex_begin_, vertex_end_;
  std::vector<double> flex_radius_;
};

}  // namespace tauguard::contacts
