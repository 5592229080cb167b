// What the native tests share: a count of wrong answers, and numbers of the hard kinds.
#pragma once

#include <cmath>
#include <cstdio>
#include <random>

using Random = std::mt19937_64;

inline int failures = 0;
inline void check(bool right, const char* what) {
  if (right) return;
  ++failures;
  std::printf("wrong: %s\n", what);
}

// Zero, a power of two times a short fraction, far from the origin, or a small integer.
inline double hard_number(Random& random) {
  switch (random() % 8) {
    case 0:
      return 0;
    case 1:
      return std::ldexp(1.0 + double(random() % 1024), int(random() % 120) - 60);
    case 2:
      return 1e6 + double(random() % 8) * 0x1p-20;
    default:
      return double(int(random() % 5)) - 2;
  }
}
