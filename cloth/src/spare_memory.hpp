// Reuses the memory of arrays that were returned to the caller and freed, because fresh memory
// pages cost more time than writing the arrays.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <new>
#include <vector>

namespace tauguard::cloth {

class SpareMemory {
 public:
  SpareMemory() { blocks_.reserve(most); }
  SpareMemory(const SpareMemory&) = delete;
  SpareMemory& operator=(const SpareMemory&) = delete;
  ~SpareMemory() {
    for (const auto& block : blocks_) std::free(block.at);
  }

  struct Block {
    void* at;
    std::size_t bytes;
  };
  // A block of at least `bytes`, not zeroed: the smallest kept block that is large enough, or
  // a new one if each of these is more than 4 times as large.
  Block take(std::size_t bytes) {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      auto best = blocks_.end();
      for (auto b = blocks_.begin(); b != blocks_.end(); ++b)
        if (b->bytes >= bytes && b->bytes / 4 <= bytes &&
            (best == blocks_.end() || b->bytes < best->bytes))
          best = b;
      if (best != blocks_.end()) {
        const Block block = *best;
        blocks_.erase(best);
        return block;
      }
    }
    const std::size_t some = bytes + bytes / 8 + 64;  // the next frame may need slightly more
    if (void* at = std::malloc(some)) return {at, some};
    throw std::bad_alloc();
  }
  void give(Block block) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (blocks_.size() == most) {  // the oldest is the least likely to fit
      std::free(blocks_.front().at);
      blocks_.erase(blocks_.begin());
    }
    blocks_.push_back(block);
  }
  std::size_t bytes() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    std::size_t sum = 0;
    for (const auto& block : blocks_) sum += block.bytes;
    return sum;
  }

 private:
  static constexpr std::size_t most = 12;  // 2 kinds of collisions with 5 arrays, and 2 to sort
  mutable std::mutex mutex_;
  std::vector<Block> blocks_;
};

// An array of numbers in reused memory. Its last owner returns the memory for reuse.
template <class T>
class SpareArray {
 public:
  SpareArray() = default;
  SpareArray(std::shared_ptr<SpareMemory> from, std::size_t size) : size_(size) {
    const SpareMemory::Block block = from->take(size * sizeof(T));
    block_ = std::shared_ptr<void>(block.at, [from, block](void*) { from->give(block); });
  }
  T* data() { return static_cast<T*>(block_.get()); }
  const T* data() const { return static_cast<const T*>(block_.get()); }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }
  bool operator==(const SpareArray& other) const {
    return std::equal(data(), data() + size_, other.data(), other.data() + other.size_);
  }

 private:
  std::shared_ptr<void> block_;
  std::size_t size_ = 0;
};

}  // namespace tauguard::cloth
