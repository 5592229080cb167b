// Identifies the process, to detect a fork: the child gets all memory and locks of its parent, but
// only one of the threads.
#pragma once

#if !defined(_WIN32)
#include <unistd.h>
#endif

namespace tauguard::geometry {

#if defined(_WIN32)
inline long process_number() { return 1; }  // this system has no fork
#else
inline long process_number() { return static_cast<long>(getpid()); }
#endif

}  // namespace tauguard::geometry
