// Converts errors of MuJoCo to C++ exceptions. By default mju_error ends the process.
//
// MuJoCo passes an error to the thread's log handler, which must not return. The handler here jumps
// back to the call of MuJoCo. Every call has its own jump buffer, so the jump skips only frames of
// MuJoCo, and destructors of this library run as usual.
#pragma once

#include <csetjmp>
#include <stdexcept>

namespace tauguard::contacts {

// An error of MuJoCo, with the message of mju_error.
struct MujocoError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// MuJoCo's functions for log handlers, and the layout of a log message.
struct Logging {
  using Handler = void (*)(const void*);
  Handler (*set)(Handler) = nullptr;  // sets this thread's handler and returns the previous one
  Handler (*global)() = nullptr;      // returns the handler of all threads
  int error = 0;                      // the level of errors
  int at_subject = 0;                 // offset of the text; the level is the first field, an int
};

// While this object lives, errors of the thread become exceptions.
class Catching {
 public:
  explicit Catching(const Logging& logging);
  ~Catching();
  Catching(const Catching&) = delete;
  Catching& operator=(const Catching&) = delete;

 private:
  const Logging& logging_;
  const Logging* outer_;
  Logging::Handler before_, outer_before_;
};

// The jump target of the thread's innermost call of MuJoCo; nullptr outside of calls.
std::jmp_buf*& landing();
[[noreturn]] void throw_error();

// A function of MuJoCo that may fail. While a Catching lives, an error throws MujocoError.
template <class... A>
class Call {
 public:
  using Function = void (*)(A...);
  Call(Function function = nullptr) : function_(function) {}
  void operator()(A... a) const {
    std::jmp_buf here;
    std::jmp_buf*& target = landing();
    std::jmp_buf* const outer = target;
    target = &here;
    // _setjmp does not save the signal mask, which would need a system call.
    if (_setjmp(here) != 0) {
      target = outer;
      throw_error();
    }
    function_(a...);
    target = outer;
  }

 private:
  Function function_;
};

}  // namespace tauguard::contacts
