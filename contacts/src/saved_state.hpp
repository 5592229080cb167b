// Saves a guard's memory of earlier steps as bytes, so that a copy of the guard continues
// with bit-identical results.
#pragma once

#include <cstring>
#include <stdexcept>
#include <type_traits>
#include <vector>

namespace tauguard::contacts {

class Writer {
 public:
  template <class T>
  void operator()(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    const char* from = reinterpret_cast<const char*>(&value);
    bytes_.insert(bytes_.end(), from, from + sizeof value);
  }
  template <class T>
  void operator()(const std::vector<T>& values) {
    (*this)(values.size());
    for (const T& value : values) (*this)(value);
  }
  const std::vector<char>& bytes() const { return bytes_; }

 private:
  std::vector<char> bytes_;
};

class Reader {
 public:
  Reader(const char* bytes, std::size_t size) : at_(bytes), end_(bytes + size) {}
  template <class T>
  void operator()(T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    if (static_cast<std::size_t>(end_ - at_) < sizeof value) fail();
    std::memcpy(&value, at_, sizeof value), at_ += sizeof value;
  }
  // Reads a list, which must have the saved length.
  template <class T>
  void operator()(std::vector<T>& values) {
    std::size_t count = 0;
    (*this)(count);
    if (count != values.size()) fail();
    for (T& value : values) (*this)(value);
  }
  void end() const {
    if (at_ != end_) fail();
  }

 private:
  [[noreturn]] static void fail() {
    throw std::invalid_argument("the saved state is of another model or version");
  }
  const char *at_, *end_;
};

}  // namespace tauguard::contacts
