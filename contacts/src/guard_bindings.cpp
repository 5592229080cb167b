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

// Reads the listed fields of a struct from a dict. Pointers are addresses; Python keeps the objects
// behind them alive.
template <class Struct>
Struct read(const nb::dict& values) {
  Struct out{};
  geometry::for_each_field(out, [&](const std::string& name, auto& field) {
    using T = std::remove_reference_t<decltype(field)>;
    const nb::object value = values[name.c_str()];
    if constexpr (std::is_pointer_v<T>)
      field = reinterpret_cast<T>(nb::cast<std::uintptr_t>(value));
    else if constexpr (std::is_class_v<T>)
      field = reinterpret_cast<typename T::Function>(nb::cast<std::uintptr_t>(value));
    else
      field = nb::cast<T>(value);
  });
  return out;
}

nb::object array_of(const std::vector<double>& values) {
  return nb::cast(owned(std::vector<double>(values), std::array<std::size_t, 1>{values.size()}));
}

class Guard {
 public:
  Guard(const nb::dict& addresses, const nb::dict& settings, nb::object held)
      : engine_(read<Engine>(addresses)), held_(std::move(held)), s_(read<Settings>(settings)) {}

  int add(int kind, Doubles size, double radius, int body, Doubles pos, Doubles mat,
          Rows3 vertices) {
    const auto [shape, frame] = shape_of(kind, size, radius, pos, mat, vertices);
    return covered_.verdict.add(shape, body, frame);
  }
  void pair(Ints a, Ints b) {
    covered_.verdict.add_pair(list<std::int32_t>(a), list<std::int32_t>(b));
  }
  void flex_pair(Ints a, Doubles radii, IntRows elements, Bytes skip) {
    covered_.verdict.add_flex_pair(list<std::int32_t>(a), list<double>(radii),
                                   list<std::int32_t>(elements),
                                   static_cast<int>(elements.shape(1)), list<std::uint8_t>(skip));
  }
  // Partners of every pair, in the order in which pairs were added; pairs of flexes are last. A row
  // is (kind, number) of the first partner, of the second partner and of the object that has the
  // contact parameters, and the last level.
  void partners(IntRows rows) {
    for (std::size_t i = 0; i < rows.shape(0); ++i) {
      const std::int32_t* r = rows.data() + 7 * i;
      const auto place = [&](int k) { return Place{static_cast<Place::Kind>(r[k]), r[k + 1]}; };
      covered_.pairs.push_back({place(0), place(2), place(4)});
      covered_.last_level.push_back(r[6]);
    }
  }
  void sheet(const Sheet& sheet) { covered_.sheets.push_back(sheet); }
  void spins(Ints dofs) { covered_.spins = list<int>(dofs); }
  void pulled(Bytes equalities) { covered_.pulled = list<char>(equalities); }

  // Fields that the guard has copied (their present values are the reference), and numbers that
  // must be valid: address, size [bytes], Numbers::Rule.
  void follow(FollowedFields::Regions fields, std::vector<Numbers::Region> numbers) {
    model_ = FollowedModel(std::move(fields), std::move(numbers));
  }
  bool changed() const { return model_.changed(); }
  // Removes everything that was added since the last start.
  void clear() { covered_ = {}; }

  // Call this after everything was added. `sheets`: whether pairs of flexes are covered;
  // `owner._tunnelling_events` finds their crossings.
  void start(bool sheets) {
    if (stepper_)
      stepper_->follow(std::move(covered_));
    else
      stepper_ = std::make_unique<Stepper>(engine_, std::move(covered_), s_);
    clear();
    Stepper::TunnellingEvents find;
    if (sheets) find = [this](std::vector<PairHit>* hits) { add_tunnelling(hits); };
    stepper_->set_tunnelling(std::move(find));
    stepper_->set_interrupted([] {
      const nb::gil_scoped_acquire acquire;
      return PyErr_Occurred() != nullptr;
    });
  }

  // One step. Returns the number of contacts, or -1 if there is more to report. `owner` owns this
  // object, so a reference to it is kept only during the call.
  int step(nb::handle owner, nb::object each) {
    refuse_within_step();
    const Stepping stepping(this);
    owner_ = owner;
    if (model_.needs_check() || !stepper_->acceptable()) owner.attr("_follow")();
    if (engine_.has_callbacks() != bound_) {
      bound_ = !bound_;
      const nb::object address = bound_ ? owner.attr("_bound_copy")() : nb::int_(0);
      stepper_->bind(reinterpret_cast<void*>(nb::cast<std::uintptr_t>(address)));
    }
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
  using Cuts = nb::typed<nb::list, nb::typed<nb::tuple, double, int>>;
  nb::typed<nb::tuple, int, int, Cuts, Integers, Integers, bool, double, double,
            std::optional<nb::bytes>>
  report() const {
    const Report& r = stepper_->report();
    const auto ids = [](const std::vector<int>& values) {
      nb::list out;
      for (const int v : values) out.append(v);
      return out;
    };
    nb::list cuts;
    for (const Cut& cut : r.cuts) cuts.append(nb::make_tuple(cut.time, cut.pair));
    return nb::make_tuple(r.steps, r.contacts, cuts, ids(r.passed), ids(r.impact_zones), r.unaided,
                          r.standstill, r.added, r.rolled_back ? states() : nb::none());
  }

  Integers sunk() const {
    if (stepping_ != std::this_thread::get_id()) refuse_within_step();
    Integers out;
    for (const int pair : stepper_->sunk()) out.append(pair);
    return out;
  }
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
  Settings s_;
  Coverage covered_;  // added since the last start
  std::unique_ptr<Stepper> stepper_;
  bool bound_ = false;        // whether callbacks are set, which need a model that Python knows
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
      .def("add", &Guard::add, "kind"_a, "size"_a, "radius"_a, "body"_a, "pos"_a, "mat"_a,
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
      .def("sunk", &Guard::sunk)
      .def("follow", &Guard::follow, "fields"_a, "numbers"_a)
      .def("changed", &Guard::changed)
      .def("clear", &Guard::clear)
      .def("saved", &Guard::saved)
      .def("restore", &Guard::restore, "state"_a)
      .def("reset", &Guard::reset);
}

}  // namespace tauguard::contacts
