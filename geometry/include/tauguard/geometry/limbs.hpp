// The digits of a big number: a vector of 64-bit limbs. A short vector is stored inside the object,
// because an allocation by std::vector costs more than arithmetic on a few limbs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>
#include <memory>

namespace tauguard::geometry {

class Limbs {
 public:
  Limbs() = default;
  Limbs(std::initializer_list<std::uint64_t> values) {
    reserve(values.size());
    for (std::uint64_t v : values) data()[size_++] = v;
  }
  Limbs(std::size_t n, std::uint64_t value) { assign(n, value); }
  explicit Limbs(std::size_t n) { assign(n, 0); }
  Limbs(const Limbs& o) { *this = o; }
  Limbs(Limbs&& o) noexcept { *this = static_cast<Limbs&&>(o); }
  Limbs& operator=(const Limbs& o) {
    if (this == &o) return *this;
    size_ = 0;
    reserve(o.size_);
    std::memcpy(data(), o.data(), o.size_ * sizeof(std::uint64_t));
    size_ = o.size_;
    return *this;
  }
  Limbs& operator=(Limbs&& o) noexcept {
    if (this == &o) return *this;
    if (o.far_) {
      far_ = std::move(o.far_);
      capacity_ = o.capacity_;
      o.capacity_ = near_capacity;
    } else {  // fits the present storage
      std::memcpy(data(), o.near_, o.size_ * sizeof(std::uint64_t));
    }
    size_ = o.size_;
    o.size_ = 0;
    return *this;
  }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  std::uint64_t* data() { return far_ ? far_.get() : near_; }
  const std::uint64_t* data() const { return far_ ? far_.get() : near_; }
  std::uint64_t& operator[](std::size_t i) { return data()[i]; }
  std::uint64_t operator[](std::size_t i) const { return data()[i]; }
  std::uint64_t back() const { return data()[size_ - 1]; }
  const std::uint64_t* begin() const { return data(); }
  const std::uint64_t* end() const { return data() + size_; }

  void reserve(std::size_t n) {
    if (n <= capacity_) return;
    const std::size_t capacity = std::max(n, 2 * capacity_);
    std::unique_ptr<std::uint64_t[]> grown(new std::uint64_t[capacity]);
    std::memcpy(grown.get(), data(), size_ * sizeof(std::uint64_t));
    far_ = std::move(grown);
    capacity_ = capacity;
  }
  void assign(std::size_t n, std::uint64_t value) {
    size_ = 0;
    reserve(n);
    std::fill(data(), data() + n, value);
    size_ = n;
  }
  void push_back(std::uint64_t v) {
    reserve(size_ + 1);
    data()[size_++] = v;
  }
  void pop_back() { --size_; }
  void drop_front(std::size_t n) {
    std::memmove(data(), data() + n, (size_ - n) * sizeof(std::uint64_t));
    size_ -= n;
  }

 private:
  static constexpr std::size_t near_capacity = 10;  // 640 bits hold most products of three factors

  std::uint64_t near_[near_capacity];
  std::unique_ptr<std::uint64_t[]> far_;
  std::size_t size_ = 0, capacity_ = near_capacity;
};

}  // namespace tauguard::geometry
