// A lock for an object that keeps state between calls and allows one call at a time.
//
// Ctrl-C ends the wait for the lock. Two cases would wait forever, so they raise an error:
// * A thread that already holds the lock calls again, for example from a signal handler.
// * The process was forked during a call, so no thread of the child can release the lock.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <stdexcept>
#include <thread>

#include "tauguard/geometry/interrupt.hpp"
#include "tauguard/geometry/process.hpp"

namespace tauguard::geometry {

class CallLock {
 public:
  void lock() {
    const long here = process_number();
    auto pause = std::chrono::microseconds(20);
    for (long owner = 0; !process_.compare_exchange_strong(owner, here); owner = 0) {
      if (owner != here)
        throw std::runtime_error(
            "another thread was in a call on this object when the process was forked: make a new "
            "one in the child");
      if (thread_.load() == std::this_thread::get_id())
        throw std::runtime_error("this object is already in a call of the same thread");
      poll_interrupt();
      std::this_thread::sleep_for(pause);
      pause = std::min(2 * pause, std::chrono::microseconds(2000));
    }
    thread_.store(std::this_thread::get_id());
  }
  void unlock() {
    thread_.store({});
    process_.store(0);
  }

 private:
  std::atomic<long> process_{0};  // process that holds the lock; 0 means that it is free
  std::atomic<std::thread::id> thread_{};
};

}  // namespace tauguard::geometry
