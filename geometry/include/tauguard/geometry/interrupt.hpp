// Ctrl-C ends long calls. A call opens an `InterruptScope`, kernels call `poll_interrupt` in their
// loops, and an interrupted call throws `Interrupted`.
#pragma once

#include <atomic>
#include <chrono>
#include <functional>

#include "tauguard/geometry/thread_pool.hpp"

namespace tauguard::geometry {

struct Interrupted {};

class InterruptScope {
 public:
  // Returns whether a signal is pending; set by the binding. The caller need not hold the GIL.
  static inline bool (*ask)() = nullptr;

  InterruptScope() : outer_(current_) { current_ = this; }
  ~InterruptScope() { current_ = outer_; }
  InterruptScope(const InterruptScope&) = delete;
  InterruptScope& operator=(const InterruptScope&) = delete;

  // The scope of the call that this thread works for; null if there is none.
  static InterruptScope* current() { return current_; }

  // Makes `scope` the current one of a helper thread while the object lives.
  class Loan {
   public:
    explicit Loan(InterruptScope* scope) : saved_(current_) { current_ = scope; }
    ~Loan() { current_ = saved_; }
    Loan(const Loan&) = delete;
    Loan& operator=(const Loan&) = delete;

   private:
    InterruptScope* saved_;
  };

  void poll() {
    if (stop_.load(std::memory_order_relaxed)) throw Interrupted{};
    if (std::this_thread::get_id() != owner_ || ++polls_ % 64) return;
    const auto now = std::chrono::steady_clock::now();
    if (now < next_) return;
    next_ = now + std::chrono::milliseconds(50);
    if (!ask || !ask()) return;
    stop_.store(true);
    throw Interrupted{};
  }

 private:
  static inline thread_local InterruptScope* current_ = nullptr;
  InterruptScope* const outer_;
  const std::thread::id owner_ = std::this_thread::get_id();
  std::atomic<bool> stop_{false};
  unsigned polls_ = 0;
  std::chrono::steady_clock::time_point next_{};
};

// Call this in a kernel's loop at least every few thousand operations. It takes a few nanoseconds.
inline void poll_interrupt() {
  if (InterruptScope* scope = InterruptScope::current()) scope->poll();
}

// ThreadPool::parallel_for on the shared pool, with the caller's scope in every thread.
inline void interruptible_for(
    std::size_t n, int threads, std::size_t grain,
    const std::function<void(std::size_t, std::size_t, std::size_t)>& body) {
  InterruptScope* scope = InterruptScope::current();
  ThreadPool::shared().parallel_for(n, threads, grain, [&](auto begin, auto end, auto chunk) {
    const InterruptScope::Loan loan(scope);
    poll_interrupt();
    body(begin, end, chunk);
  });
}

}  // namespace tauguard::geometry
