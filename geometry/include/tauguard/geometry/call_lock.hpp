// One call at a time on an object that keeps state between calls.
//
// Waiting ends with Ctrl-C. A thread that holds the lock already (a signal's handler that calls
// again) and a child process of which no thread can ever release it get an error in place of a
// wait without end.
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
        throw std::runtime_error("a call on this object from within a call on it");
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
  std::atomic<long> process_{0};  // of the call that holds it; 0: none
  std::atomic<std::thread::id> thread_{};
};

}  // namespace tauguard::geometry
