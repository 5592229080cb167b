// Memory that a thread keeps between calls. A nested call of the same thread, from a signal
// handler, gets separate memory.
#pragma once

#include <memory>

namespace tauguard::geometry {

template <class T>
class Scratch {
 public:
  Scratch() : own_(spare() ? std::move(spare()) : std::make_unique<T>()) {}
  ~Scratch() { spare() = std::move(own_); }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  T& operator*() { return *own_; }
  T* operator->() { return own_.get(); }

 private:
  static std::unique_ptr<T>& spare() {
    static thread_local std::unique_ptr<T> kept;
    return kept;
  }
  std::unique_ptr<T> own_;
};

}  // namespace tauguard::geometry
