// Which process this is: a fork copies memory and locks, but of the threads only the one that
// forks.
#pragma once

#if !defined(_WIN32)
#include <unistd.h>
#endif

namespace tauguard::geometry {

#if defined(_WIN32)
inline long process_number() { return 1; }  // no fork there
#else
inline long process_number() { return static_cast<long>(getpid()); }
#endif

}  // namespace tauguard::geometry
