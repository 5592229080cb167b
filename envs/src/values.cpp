// Python bindings of the structs that a plant is built from. Python gives each listed member by
// keyword; the headers describe the members.
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "plant.hpp"

namespace tauguard::envs {
namespace {

template <class T>
void take(nb::handle value, T& out) {
  if constexpr (std::is_enum_v<T>)
    out = static_cast<T>(nb::cast<int>(value));
  else
    out = nb::cast<T>(value);
}
void take(nb::handle value, Held& out) { out = held(nb::cast<Array>(value)); }
void take(nb::handle value, Vec3& out) {
  const auto given = nb::cast<Numbers>(value);
  if (given.size() != 3) throw std::invalid_argument("expected three numbers");
  out = load(given.data());
}
void take(nb::handle value, std::vector<Person>& out) {
  const auto given = nb::cast<std::vector<Anatomy>>(value);
  out = std::vector<Person>(given.begin(), given.end());
}
void take(nb::handle value, Barriers& out) { take(value, out.all); }

template <class Struct>
void bind_fields(nb::module_& m, const char* name) {
  nb::class_<Struct>(m, name).def(
      "__init__",
      [name](Struct* self, const nb::kwargs& given) {
        Struct made{};
        std::size_t count = 0;
        geometry::for_each_field(made, [&](const std::string& field, auto& member) {
          if (!given.contains(field.c_str()))
            throw nb::type_error((name + (": missing keyword " + field)).c_str());
          take(given[field.c_str()], member);
          ++count;
        });
        if (given.size() != count)
          throw nb::type_error((std::string(name) + ": unknown keyword; known are " +
                                std::string(Struct::field_names))
                                   .c_str());
        new (self) Struct(std::move(made));
      },
      nb::sig("def __init__(self, **kwargs: object) -> None"));
}

}  // namespace

void bind_values(nb::module_& m) {
  bind_fields<Joint>(m, "Joint");
  bind_fields<Anatomy>(m, "Anatomy");
  bind_fields<Link>(m, "Link");
  bind_fields<Kinematics>(m, "Kinematics");
  bind_fields<Tool>(m, "Tool");
  bind_fields<Region>(m, "Region");
  bind_fields<Barrier>(m, "Barrier");
  bind_fields<Surroundings>(m, "Surroundings");
  bind_fields<Touched>(m, "Touched");
  bind_fields<Rows>(m, "Rows");
  bind_fields<Track>(m, "Track");
  bind_fields<Controls>(m, "Controls");
}

}  // namespace tauguard::envs
