// A copy of the model for sub-steps, whose options and contact parameters may be changed. The
// user's model, which other guards and threads may use, is only read.
//
// The copy shares all arrays with the user's model, except the contact parameters. Callbacks in
// Python need a model that the Python binding knows. If there is one (`bound`), it is used instead.
#pragma once

#include <vector>

#include "engine.hpp"

namespace tauguard::contacts {

class ModelCopy {
 public:
  explicit ModelCopy(const Engine& engine) : e_(engine) {}
  ModelCopy(const ModelCopy&) = delete;
  ModelCopy& operator=(const ModelCopy&) = delete;

  // Uses a model that the Python binding knows; nullptr: no more.
  void bind(void* model) { bound_ = model; }
  // Takes the present values of the user's model.
  void take();
  const void* get() const { return base(); }

  // The copy's option at the address `option` in the user's model.
  template <class T>
  T& option(const T* option) {
    return *reinterpret_cast<T*>(
        base() + (reinterpret_cast<const char*>(option) - static_cast<const char*>(e_.model)));
  }
  // The copy's parameters, indexed by Place::Kind.
  double* margin(int kind) { return array<double>(e_.at_margin[kind]); }
  double* solref(int kind) { return array<double>(e_.at_solref[kind]); }
  double* solimp(int kind) { return array<double>(e_.at_solimp[kind]); }
  double* friction(int kind) { return array<double>(e_.at_friction[kind]); }
  int* priority(int kind) { return kind ? array<int>(e_.at_priority[kind]) : nullptr; }

 private:
  char* base() const {
    return bound_ ? static_cast<char*>(bound_) : const_cast<char*>(struct_.data());
  }
  template <class T>
  T* array(std::size_t at) {
    T* out;
    std::memcpy(&out, base() + at, sizeof out);
    return out;
  }
  template <class T>
  void replace(std::size_t at, std::size_t count, std::vector<T>* values);

  const Engine& e_;
  void* bound_ = nullptr;
  std::vector<char> struct_;
  std::vector<double> values_[3][4];
  std::vector<int> priorities_[3];
};

}  // namespace tauguard::contacts
