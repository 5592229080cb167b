// Lists the members of a struct by name, so that a binding needs no list of its own.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <tuple>

// Lists members of the struct that contains this line.
#define TAUGUARD_FIELDS(...)                                    \
  static constexpr std::string_view field_names = #__VA_ARGS__; \
  auto fields() { return std::tie(__VA_ARGS__); }

namespace tauguard::geometry {

// Calls visit(name, member) for each listed member, in order.
template <class Struct, class Visit>
void for_each_field(Struct& s, const Visit& visit) {
  std::string_view names = Struct::field_names;
  const auto next = [&names] {
    const std::string name(names.substr(0, names.find(',')));
    names.remove_prefix(std::min(names.size(), name.size() + 2));  // ", "
    return name;
  };
  std::apply([&](auto&... member) { (visit(next(), member), ...); }, s.fields());
}

// Adds the listed members of `more`.
template <class Struct>
void add_fields(Struct& sum, Struct more) {
  const auto each = [&](auto&... mine) {
    std::apply([&](auto&... own) { ((mine += own), ...); }, more.fields());
  };
  std::apply(each, sum.fields());
}

}  // namespace tauguard::geometry
