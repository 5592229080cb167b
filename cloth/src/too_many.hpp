// Exception for a result that exceeds the caller's limit.
#pragma once

#include <stdexcept>
#include <string>

namespace tauguard::cloth {

struct TooMany : std::runtime_error {
  TooMany(const std::string& what, std::size_t limit)
      : std::runtime_error("limit: more than " + std::to_string(limit) + " " + what +
                           " in this step; a larger limit= allows them and takes more memory") {}
};

}  // namespace tauguard::cloth
