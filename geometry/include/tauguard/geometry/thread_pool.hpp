// A small persistent thread pool. Work is divided into chunks that do not depend on the number of
// threads. A kernel that writes its results to places indexed by item or by chunk therefore gives
// the same bits for any number of threads.
//
// Threads do not survive a fork. The child gets its own pool at its first call. It never waits for
// the parent's threads, not even at its exit.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

#include "tauguard/geometry/process.hpp"
#include "tauguard/geometry/rounding.hpp"

namespace tauguard::geometry {

class ThreadPool {
 public:
  // One pool per native module and process, with the largest number of threads requested so far. It
  // is never destroyed: at exit its threads may be in a call or, after a fork, not exist.
  static ThreadPool& shared() {
    static std::atomic<ThreadPool*> kept{nullptr};
    ThreadPool* pool = kept.load();
    if (pool && pool->process_ == process_number()) return *pool;
    auto fresh = std::make_unique<ThreadPool>();
    if (kept.compare_exchange_strong(pool, fresh.get())) return *fresh.release();
    return *pool;  // another thread was faster
  }

  // The default for `threads=0`: the number of processors.
  static int hardware() { return std::max(1u, std::thread::hardware_concurrency()); }

  // Calls body(begin, end, chunk) for consecutive chunks of `grain` items that cover [0, n), on up
  // to `threads` threads (including the caller's; 0 means all processors). Every thread rounds to
  // nearest. The first exception of a chunk is rethrown here after all chunks have stopped.
  void parallel_for(std::size_t n, int threads, std::size_t grain,
                    const std::function<void(std::size_t, std::size_t, std::size_t)>& body) {
    if (n == 0) return;
    grain = std::max<std::size_t>(grain, 1);
    const std::size_t chunks = (n + grain - 1) / grain;
    const RoundToNearest guard;
    const std::size_t wanted = std::min<std::size_t>(threads <= 0 ? hardware() : threads, chunks);
    // A nested call, and a call during another thread's call, run without helpers.
    std::unique_lock<std::mutex> one_caller(caller_, std::defer_lock);
    if (wanted <= 1 || inside_ || !one_caller.try_lock()) {
      for (std::size_t c = 0; c < chunks; ++c) body(c * grain, std::min(n, (c + 1) * grain), c);
      return;
    }
    const Inside inside;
    job_.body = &body;
    job_.n = n;
    job_.grain = grain;
    job_.chunks = chunks;
    job_.next.store(0);
    job_.error = nullptr;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      grow(wanted - 1);
      helpers_ = std::min(workers_.size(), wanted - 1);
      busy_ = helpers_;
      ++generation_;
    }
    wake_.notify_all();
    work();
    wait_awake([this] { return busy_ == 0; });
    std::unique_lock<std::mutex> lock(mutex_);
    done_.wait(lock, [this] { return busy_ == 0; });
    if (job_.error) std::rethrow_exception(job_.error);
  }

  ~ThreadPool() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stop_ = true;
      ++generation_;
    }
    wake_.notify_all();
    for (auto& w : workers_) w.join();
  }

 private:
  // A waiting thread spins for this time before it sleeps, because a wake-up takes some 50 us.
  static constexpr std::chrono::microseconds awake{200};

  static inline thread_local bool inside_ = false;
  struct Inside {
    Inside() { inside_ = true; }
    ~Inside() { inside_ = false; }
  };

  struct Job {
    const std::function<void(std::size_t, std::size_t, std::size_t)>* body = nullptr;
    std::size_t n = 0, grain = 1, chunks = 0;
    std::atomic<std::size_t> next{0};
    std::exception_ptr error;
    std::mutex error_mutex;
  };

  // Spins until `met` or until the time `awake` is over. A job that follows within this time, as
  // the next step of an environment does, needs no wake-up.
  template <class Condition>
  static void wait_awake(const Condition& met) {
    const auto end = std::chrono::steady_clock::now() + awake;
    while (!met() && std::chrono::steady_clock::now() < end) std::this_thread::yield();
  }

  void grow(std::size_t helpers) {
    try {
      while (workers_.size() < helpers)
        workers_.emplace_back([this, i = workers_.size()] { serve(i); });
    } catch (const std::system_error&) {  // no more threads available: use fewer
    }
  }

  void work() {
    for (;;) {
      const std::size_t c = job_.next.fetch_add(1);
      if (c >= job_.chunks) return;
      try {
        (*job_.body)(c* job_.grain, std::min(job_.n, (c + 1) * job_.grain), c);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(job_.error_mutex);
        if (!job_.error) job_.error = std::current_exception();
        job_.next.store(job_.chunks);
      }
    }
  }

  void serve(std::size_t index) {
    const RoundToNearest guard;
    const Inside inside;
    std::size_t seen = 0;
    for (;;) {
      wait_awake([&] { return generation_ != seen; });
      {
        std::unique_lock<std::mutex> lock(mutex_);
        // A worker that is not part of this job (or was created after its start) sleeps.
        wake_.wait(lock, [&] { return generation_ != seen; });
        seen = generation_;
        if (stop_) return;
        if (index >= helpers_) continue;
      }
      work();
      const std::lock_guard<std::mutex> lock(mutex_);
      if (--busy_ == 0) done_.notify_one();
    }
  }

  std::mutex caller_, mutex_;
  std::condition_variable wake_, done_;
  std::vector<std::thread> workers_;
  Job job_;
  std::size_t helpers_ = 0;
  std::atomic<std::size_t> busy_{0}, generation_{0};
  bool stop_ = false;
  const long process_ = process_number();
};

}  // namespace tauguard::geometry
