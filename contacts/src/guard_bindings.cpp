// Binding of the guarded stepper.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>

#include "arrays.hpp"
#include "followed_fields.hpp"
#include "saved_state.hpp"
#include "stepper.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace tauguard::contacts {
namespace {

// Sets fields of an Engine from addresses and numbers in a dict; Python keeps the objects alive.
class Addresses {
 public:
  explicit Addresses(const nb::dict& values) : values_(values) {}
  std::int64_t number(const char* name) const { return nb::cast<std::int64_t>(values_[name]); }
  template <class T>
  void set(const char* name, T* field) const {
    if constexpr (std::is_pointer_v<T>)
      *field = reinterpret_cast<T>(static_cast<std::uintptr_t>(number(name)));
    else if constexpr (std::is_class_v<T>)
      *field = reinterpret_cast<typename T::Function>(static_cast<std::uintptr_t>(number(name)));
    else
      *field = static_cast<T>(number(name));
  }

 private:
  const nb::dict& values_;
};

void set_functions(const Addresses& a, Engine* e) {
  a.set("mj_step", &e->step), a.set("mj_step1", &e->step1), a.set("mj_step2", &e->step2);
  a.set("mj_kinematics", &e->kinematics), a.set("mj_comPos", &e->com_pos);
  a.set("mj_comVel", &e->com_vel), a.set("mj_flex", &e->flex), a.set("mj_tendon", &e->tendon);
  a.set("mj_makeM", &e->make_m), a.set("mj_energyPos", &e->energy_pos);
  a.set("mj_getState", &e->get_state), a.set("mj_setState", &e->set_state);
  a.set("mj_copyState", &e->copy_state), a.set("mj_mulM", &e->mul_m);
  a.set("mj_mulJacVec", &e->mul_jac);
  a.set("mj_jacBodyCom", &e->jac_com), a.set("mj_jac", &e->jac), a.set("mj_solveM", &e->solve_m);
  a.set("mj_integratePos", &e->integrate);
  a.set("_mjPRIVATE_setTlsLogHandler", &e->logging.set);
  a.set("_mjPRIVATE_getGlobalLogHandler", &e->logging.global);
  a.set("log_error", &e->logging.error), a.set("at_subject", &e->logging.at_subject);
}

void set_model(const Addresses& a, Engine* e) {
  a.set("model", &e->model), a.set("timestep", &e->timestep);
  a.set("disableflags", &e->disableflags), a.set("integrator", &e->integrator);
  a.set("enableflags", &e->enableflags), a.set("o_margin", &e->o_margin);
  a.set("o_solref", &e->o_solref), a.set("mjcb_contactfilter", &e->contact_filter);
  a.set("runge_kutta", &e->runge_kutta), a.set("override", &e->override_flag);
  a.set("refused", &e->refused), a.set("at_pstack", &e->at_stack), a.set("at_pbase", &e->at_frames);
  a.set("cone", &e->cone), a.set("solver", &e->solver), a.set("iterations", &e->iterations);
  const char* kinds[3] = {"pair", "geom", "flex"};
  for (int k = 0; k < 3; ++k) {
    const std::string kind = kinds[k];
    a.set((kind + "_margin").c_str(), &e->margin[k]);
    a.set((kind + "_solref").c_str(), &e->solref[k]);
    a.set((kind + "_solimp").c_str(), &e->solimp[k]);
    a.set((kind + "_friction").c_str(), &e->friction[k]);
    e->priority[k] = nullptr;
    if (k > 0) a.set((kind + "_priority").c_str(), &e->priority[k]);
  }
  a.set("pair_geom1", &e->pair_geom1), a.set("pair_geom2", &e->pair_geom2);
  a.set("flex_vertbodyid", &e->flex_vertbodyid), a.set("flex_vert", &e->flex_vert);
  a.set("geom_bodyid", &e->geom_bodyid), a.set("body_rootid", &e->body_rootid);
  a.set("body_dofnum", &e->body_dofnum), a.set("body_weldid", &e->body_weldid);
  a.set("body_mocapid", &e->body_mocapid), a.set("nmocap", &e->nmocap);
  a.set("nq", &e->nq), a.set("nv", &e->nv), a.set("nbody", &e->nbody);
  a.set("ngeom", &e->ngeom), a.set("npair", &e->npair), a.set("nflex", &e->nflex);
  a.set("nflexvert", &e->nflexvert);
  a.set("ntendon", &e->ntendon), a.set("interpolated", &e->interpolated);
  a.set("state_size", &e->state_size), a.set("sig_integration", &e->signature.integration);
  a.set("sig_pose", &e->signature.pose), a.set("discrete", &e->discrete);
  a.set("pyramidal", &e->pyramidal), a.set("elliptic", &e->elliptic);
  a.set("refsafe", &e->refsafe);
  a.set("newton", &e->newton), a.set("equality", &e->equality);
}

void set_data(const Addresses& a, Engine* e) {
  a.set("data", &e->data), a.set("end", &e->end), a.set("time", &e->time);
  a.set("qpos", &e->qpos), a.set("qvel", &e->qvel), a.set("energy", &e->energy);
  a.set("qfrc_actuator", &e->actuator), a.set("qfrc_applied", &e->applied);
  a.set("reset_qpos", &e->resets[0]), a.set("reset_qvel", &e->resets[1]);
  a.set("reset_qacc", &e->resets[2]);
  a.set("xfrc_applied", &e->wrench), a.set("xpos", &e->xpos), a.set("xmat", &e->xmat);
  a.set("xipos", &e->xipos);
  a.set("flexvert_xpos", &e->flexvert), a.set("ncon", &e->ncon), a.set("nefc", &e->nefc);
  a.set("contact", &e->contacts), a.set("contact_size", &e->contact_size);
  a.set("at_dist", &e->at_dist), a.set("at_dim", &e->at_dim), a.set("at_geom", &e->at_geom);
  a.set("at_flex", &e->at_flex), a.set("at_efc_address", &e->at_row);
  a.set("efc_aref", &e->efc_aref), a.set("efc_margin", &e->efc_margin);
  a.set("efc_vel", &e->efc_vel), a.set("efc_pos", &e->efc_pos);
  a.set("efc_force", &e->efc_force), a.set("efc_type", &e->efc_type);
  a.set("efc_id", &e->efc_id), a.set("at_pos", &e->at_pos), a.set("at_frame", &e->at_frame);
  a.set("mocap_pos", &e->mocap_pos), a.set("mocap_quat", &e->mocap_quat);
  a.set("end_qvel", &e->end_qvel), a.set("end_energy", &e->end_energy);
  a.set("end_xpos", &e->end_xpos), a.set("end_xmat", &e->end_xmat);
  a.set("end_flexvert_xpos", &e->end_flexvert), a.set("end_cvel", &e->end_cvel);
  a.set("other", &e->other), a.set("other_energy", &e->other_energy);
  a.set("other_mocap_pos", &e->other_mocap_pos), a.set("other_mocap_quat", &e->other_mocap_quat);
  a.set("other_xpos", &e->other_xpos), a.set("other_xmat", &e->other_xmat);
  a.set("other_flexvert_xpos", &e->other_flexvert);
}

Engine engine_of(const nb::dict& values) {
  const Addresses a(values);
  Engine e{};
  set_functions(a, &e), set_model(a, &e), set_data(a, &e);
  return e;
}

nb::object array_of(const std::vector<double>& values) {
  return nb::cast(owned(std::vector<double>(values), std::array<std::size_t, 1>{values.size()}));
}

class Guard {
 public:
  Guard(const nb::dict& addresses, const nb::dict& settings, nb::object held)
      : engine_(engine_of(addresses)), held_(std::move(held)) {
    const auto number = [&](const char* name) { return nb::cast<double>(settings[name]); };
    s_.stiff = number("stiff") != 0, s_.most = static_cast<int>(number("most"));
    s_.beyond = number("beyond"), s_.room = number("room"), s_.smallest = number("smallest");
    s_.push = number("push"), s_.watched = static_cast<int>(number("watched"));
    s_.look = static_cast<int>(number("look")), s_.turned = number("turned");
    s_.deeper_geom = number("deeper_geom"), s_.deeper_flex = number("deeper_flex");
    allowed_ = number("allowed");
  }

  int add(int core, Doubles size, double radius, int body, Doubles pos, Doubles mat,
          Rows3 vertices) {
    const auto [shape, frame] = shape_of(core, size, radius, pos, mat, vertices);
    return verdict_.add(shape, body, frame);
  }
  void pair(Ints a, Ints b) { verdict_.add_pair(list<std::int32_t>(a), list<std::int32_t>(b)); }
  void flex_pair(Ints a, Doubles radii, IntRows elements, Bytes skip) {
    verdict_.add_flex_pair(list<std::int32_t>(a), list<double>(radii), list<std::int32_t>(elements),
                           static_cast<int>(elements.shape(1)), list<std::uint8_t>(skip));
  }
  // Partners of every pair, in the order in which pairs were added; pairs of flexes are last. A row
  // is (kind, number) of the first partner, of the second partner and of the object that has the
  // contact parameters, and the last level.
  void partners(IntRows rows) {
    for (std::size_t i = 0; i < rows.shape(0); ++i) {
      const std::int32_t* r = rows.data() + 7 * i;
      const auto place = [&](int k) { return Place{static_cast<Place::Kind>(r[k]), r[k + 1]}; };
      pairs_.push_back({place(0), place(2), place(4)}), last_.push_back(r[6]);
    }
  }
  void sheet(const Sheet& sheet) { sheets_.push_back(sheet); }
  void spins(Ints dofs) { spins_ = list<int>(dofs); }
  void pulled(Bytes equalities) { pulled_ = list<char>(equalities); }

  // Fields that the guard has copied (their present values are the reference), and numbers that
  // must be valid: address, size [bytes], Numbers::Rule.
  void follow(FollowedFields::Regions fields, std::vector<Numbers::Region> numbers) {
    model_ = FollowedModel(std::move(fields), std::move(numbers));
  }
  bool changed() const { return model_.changed(); }
  // Removes everything that was added since the last start.
  void clear() {
    verdict_ = Verdict{}, pairs_.clear(), last_.clear(), sheets_.clear(), spins_.clear();
    pulled_.clear();
  }

  // Call this after everything was added. `sheets`: whether pairs of flexes are covered;
  // `owner._tunnelling_events` finds their crossings.
  void start(bool sheets) {
    if (stepper_)
      stepper_->follow(std::move(verdict_), std::move(pairs_), std::move(last_), std::move(sheets_),
                       std::move(spins_), std::move(pulled_));
    else
      stepper_ = std::make_unique<Stepper>(engine_, std::move(verdict_), std::move(pairs_),
                                           std::move(last_), std::move(sheets_), std::move(spins_),
                                           std::move(pulled_), s_, allowed_);
    clear();
    Stepper::TunnellingEvents find;
    if (sheets) find = [this](std::vector<PairHit>* hits) { add_tunnelling(hits); };
    stepper_->set_tunnelling(std::move(find));
  }

  // One step. Returns the number of contacts, or -1 if there is more to report. `owner` owns this
  // object, so a reference to it is kept only during the call.
  int step(nb::handle owner, nb::object each) {
    refuse_within_step();
    const Stepping stepping(this);
    owner_ = owner;
    if (model_.to_look_at() || !stepper_->acceptable()) owner.attr("_follow")();
    std::function<void()> call;
    if (!each.is_none())
      call = [&each] {
        const nb::gil_scoped_acquire acquire;
        each();
      };
    bool quiet;
    const Stacks stacks(engine_);
    try {
      const nb::gil_scoped_release release;
      const tauguard::geometry::RoundToNearest guard;
      const Catching catching(engine_.logging);
      quiet = stepper_->step(call);
    } catch (const MujocoError& error) {
      undo(stacks);
      // An exception in a Python callback of MuJoCo also arrives here as an error of MuJoCo.
      if (!PyErr_Occurred())
        PyErr_SetString(nb::module_::import_("mujoco").attr("FatalError").ptr(), error.what());
      throw nb::python_error();
    } catch (...) {
      undo(stacks);
      throw;
    }
    return quiet ? stepper_->report().contacts : -1;
  }

  nb::bytes saved() const {
    refuse_within_step();
    Writer writer;
    stepper_->archive(writer);
    return nb::bytes(writer.bytes().data(), writer.bytes().size());
  }
  void restore(nb::bytes state) {
    Reader reader(state.c_str(), state.size());
    stepper_->archive(reader), reader.end();
  }

  // The fields of StepReport; if the step was rolled back, the last item has the states at its
  // start and its end, one after the other.
  using Cuts = nb::typed<nb::list, nb::typed<nb::tuple, double, int, bool>>;
  nb::typed<nb::tuple, int, int, Cuts, Integers, Integers, Integers, double,
            std::optional<nb::bytes>>
  report() const {
    const Report& r = stepper_->report();
    const auto ids = [](const std::vector<int>& values) {
      nb::list out;
      for (const int v : values) out.append(v);
      return out;
    };
    nb::list cuts;
    for (const Cut& cut : r.cuts) cuts.append(nb::make_tuple(cut.time, cut.pair, cut.stiffened));
    return nb::make_tuple(r.steps, r.contacts, cuts, ids(r.restored), ids(r.passed),
                          ids(r.impact_zones), r.added, r.rolled_back ? states() : nb::none());
  }

  Integers stiffened() const { return listed(&Stepper::stiffened); }
  Integers sunk() const { return listed(&Stepper::sunk); }
  Integers listed(std::vector<int> (Stepper::*ask)() const) const {
    if (stepping_ != std::this_thread::get_id()) refuse_within_step();
    Integers out;
    for (const int pair : ((*stepper_).*ask)()) out.append(pair);
    return out;
  }
  void close() { refuse_within_step(), stepper_->close(); }
  void reset() { refuse_within_step(), stepper_->reset(); }

 private:
  nb::object states() const {
    std::vector<double> both = stepper_->first();
    both.resize(2 * both.size());
    double* const last = both.data() + both.size() / 2;
    engine_.get_state(engine_.model, engine_.data, last, engine_.signature.integration);
    return nb::bytes(both.data(), both.size() * sizeof(double));
  }
  // Marks that a step is in progress. The flag is read and written with the GIL held.
  struct Stepping {
    explicit Stepping(Guard* guard) : guard(guard) {
      guard->stepping_ = std::this_thread::get_id();
    }
    ~Stepping() { guard->stepping_ = {}; }
    Guard* guard;
  };
  void refuse_within_step() const {
    if (stepping_ != std::thread::id{})
      throw std::runtime_error(
          "this guard is in a step, called by another thread or around this callback: wait until "
          "the step ends, or use one guard and one MjData per thread");
  }

  // Saves MuJoCo's stack pointers and restores them after an error, which does not reset them.
  struct Stacks {
    explicit Stacks(const Engine& engine) : e(engine) {
      for (int k = 0; k < 3; ++k)
        std::memcpy(&stack[k], at(k, e.at_stack), sizeof stack[k]),
            std::memcpy(&frames[k], at(k, e.at_frames), sizeof frames[k]);
    }
    void put_back() const {
      for (int k = 0; k < 3; ++k)
        std::memcpy(at(k, e.at_stack), &stack[k], sizeof stack[k]),
            std::memcpy(at(k, e.at_frames), &frames[k], sizeof frames[k]);
    }
    char* at(int k, std::size_t offset) const {
      void* const all[3] = {e.data, e.end, e.other};
      return static_cast<char*>(all[k]) + offset;
    }
    const Engine& e;
    std::size_t stack[3], frames[3];
  };

  void undo(const Stacks& stacks) {
    stacks.put_back();
    stepper_->abandon();
  }

  // Appends the rows (pair, vertices, approach) of owner._tunnelling_events(x_t1).
  void add_tunnelling(std::vector<PairHit>* hits) {
    const nb::gil_scoped_acquire acquire;
    for (const nb::handle row : owner_.attr("_tunnelling_events")(array_of(stepper_->vertices()))) {
      PairHit hit{nb::cast<int>(row[0]),    0,  true, false, false, 0,
                  nb::cast<double>(row[2]), {}, {}};
      for (const nb::handle v : row[1]) hit.corners.push_back(nb::cast<std::int32_t>(v));
      hits->push_back(std::move(hit));
    }
  }

  Engine engine_;
  FollowedModel model_;
  nb::object held_;   // keeps the objects behind the addresses alive
  nb::handle owner_;  // during a step
  Settings s_{};
  double allowed_ = 0;
  Verdict verdict_;
  std::vector<Partners> pairs_;
  std::vector<int> last_, spins_;
  std::vector<char> pulled_;
  std::vector<Sheet> sheets_;
  std::unique_ptr<Stepper> stepper_;
  std::thread::id stepping_;  // the thread that is in a step, or none
};

}  // namespace

void bind_guard(nb::module_& m) {
  nb::class_<Sheet>(m, "Sheet")
      .def(
          "__init__",
          [](Sheet* self, Ints ends, Doubles rest, Doubles stiffness) {
            new (self) Sheet{list<std::int32_t>(ends), list<double>(rest), list<double>(stiffness)};
          },
          "ends"_a, "rest"_a, "stiffness"_a)
      .def("energy", [](const Sheet& self, Rows3 x) { return self.energy(x.data()); }, "x"_a);
  nb::class_<Guard>(m, "Guard")
      .def(nb::init<nb::typed<nb::dict, nb::str, int>, nb::typed<nb::dict, nb::str, double>,
                    nb::object>(),
           "addresses"_a, "settings"_a, "held"_a)
      .def("add", &Guard::add, "core"_a, "size"_a, "radius"_a, "body"_a, "pos"_a, "mat"_a,
           "vertices"_a)
      .def("pair", &Guard::pair, "a"_a, "b"_a)
      .def("flex_pair", &Guard::flex_pair, "a"_a, "radii"_a, "elements"_a, "skip"_a)
      .def("partners", &Guard::partners, "rows"_a)
      .def("sheet", &Guard::sheet, "sheet"_a)
      .def("spins", &Guard::spins, "dofs"_a)
      .def("pulled", &Guard::pulled, "equalities"_a)
      .def("start", &Guard::start, "sheets"_a)
      .def("step", &Guard::step, "owner"_a, "each"_a.none())
      .def("report", &Guard::report)
      .def("stiffened", &Guard::stiffened)
      .def("sunk", &Guard::sunk)
      .def("follow", &Guard::follow, "fields"_a, "numbers"_a)
      .def("changed", &Guard::changed)
      .def("clear", &Guard::clear)
      .def("saved", &Guard::saved)
      .def("restore", &Guard::restore, "state"_a)
      .def("close", &Guard::close)
      .def("reset", &Guard::reset);
}

}  // namespace tauguard::contacts
