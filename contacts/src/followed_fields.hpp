// Detects changes of a model's fields, and invalid numbers in them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <tuple>
#include <utility>
#include <vector>

namespace tauguard::contacts {

class FollowedFields {
 public:
  using Regions = std::vector<std::pair<std::uintptr_t, std::size_t>>;
  FollowedFields() = default;
  // Regions are addresses and sizes in bytes; their present values are the reference. Neighbouring
  // arrays in MuJoCo's buffer, where arrays begin at multiples of 64 bytes, are compared as one.
  explicit FollowedFields(Regions regions) {
    std::sort(regions.begin(), regions.end());
    for (const auto& [at, size] : regions) {
      const char* from = reinterpret_cast<const char*>(at);
      if (!fields_.empty() && from - fields_.back().end < 64)
        fields_.back().end = std::max(fields_.back().end, from + size);
      else
        fields_.push_back({from, from + size});
    }
    take();
  }
  // Makes the present values the reference.
  void take() {
    copy_.clear();
    for (const Field& field : fields_) copy_.insert(copy_.end(), field.from, field.end);
  }
  bool changed() const {
    const char* before = copy_.data();
    for (const Field& field : fields_) {
      const std::size_t size = field.end - field.from;
      if (std::memcmp(field.from, before, size) != 0) return true;
      before += size;
    }
    return false;
  }

 private:
  struct Field {
    const char *from, *end;
  };
  std::vector<Field> fields_;
  std::vector<char> copy_;
};

// Numbers of the model that may change but must be valid.
class Numbers {
 public:
  enum Rule { finite, not_nan, not_negative };
  using Region = std::tuple<std::uintptr_t, std::size_t, int>;  // address, bytes, rule
  Numbers() = default;
  explicit Numbers(std::vector<Region> regions) : regions_(std::move(regions)) {}

  // Whether all numbers are valid.
  bool valid() const {
    for (const auto& [at, size, rule] : regions_) {
      const double* x = reinterpret_cast<const double*>(at);
      for (std::size_t i = 0; i < size / sizeof *x; ++i)
        if (!obeys(x[i], rule)) return false;
    }
    return true;
  }

 private:
  static bool obeys(double x, int rule) {
    if (rule == not_nan) return x == x;
    return std::isfinite(x) && (rule == finite || x >= 0);
  }
  std::vector<Region> regions_;
};

// The fields of a model that a guard has copied, and the numbers that must be valid.
class FollowedModel {
 public:
  FollowedModel() = default;
  FollowedModel(FollowedFields::Regions fields, std::vector<Numbers::Region> numbers)
      : fields_(fields), numbers_(numbers) {
    for (const auto& [at, size, rule] : numbers) fields.emplace_back(at, size);
    all_ = FollowedFields(std::move(fields));
  }
  // Whether a copied field has changed.
  bool changed() const { return fields_.changed(); }
  // Whether a copied field has changed or a number has become invalid.
  bool needs_check() {
    if (!all_.changed()) return false;
    if (fields_.changed() || !numbers_.valid()) return true;
    all_.take();
    return false;
  }

 private:
  FollowedFields fields_, all_;
  Numbers numbers_;
};

}  // namespace tauguard::contacts
