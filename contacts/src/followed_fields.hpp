// Detects changes of the model's fields that a guard has copied or derived something from.
#pragma once

#include <cstdint>
#include <cstring>
#include <vector>

namespace tauguard::contacts {

class FollowedFields {
 public:
  void clear() { fields_.clear(), copy_.clear(); }
  // Follows `size` bytes from `from` on; their present values are the reference.
  void add(const char* from, std::size_t size) {
    if (!fields_.empty() && fields_.back().from + fields_.back().size == from)
      fields_.back().size += size;
    else
      fields_.push_back({from, size});
    copy_.insert(copy_.end(), from, from + size);
  }
  bool changed() const {
    const char* before = copy_.data();
    for (const Field& field : fields_) {
      if (std::memcmp(field.from, before, field.size) != 0) return true;
      before += field.size;
    }
    return false;
  }

 private:
  struct Field {
    const char* from;
    std::size_t size;
  };
  std::vector<Field> fields_;
  std::vector<char> copy_;
};

}  // namespace tauguard::contacts
