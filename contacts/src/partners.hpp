// The partners of a covered pair.
#pragma once

namespace tauguard::contacts {

// An object with contact parameters: an explicit pair, a geom or a flex, and its number.
struct Place {
  enum Kind { pair, geom, flex } kind;
  int number;
  bool operator==(const Place& o) const { return kind == o.kind && number == o.number; }
};

// Both partners of a contact (flexes first), and the object whose contact parameters are changed in
// a sub-step.
struct Partners {
  Place first, second, carrier;
};

}  // namespace tauguard::contacts
