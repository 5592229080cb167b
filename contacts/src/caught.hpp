// Errors of MuJoCo as C++ exceptions. By default mju_error ends the process.
//
// MuJoCo sends an error to the thread's log handler, which must not return. The handler here jumps
// back to where MuJoCo was called, over MuJoCo's own frames and no others: every call has a jump
// buffer of its own, so that destructors of this library run as usual.
#pragma once

#include <csetjmp>
#include <stdexcept>

namespace tauguard::contacts {

// The message of mju_error.
struct MujocoError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// MuJoCo's functions for handlers, and its layout of a message, as far as they are needed.
struct Logging {
  using Handler = void (*)(const void*);
  Handler (*set)(Handler) = nullptr;  // sets this thread's handler and returns the previous one
  Handler (*global)() = nullptr;      // of all threads
  int error = 0;                      // the level of an error
  int at_subject = 0;                 // offset of the text; the level is the first field, an int
};

// Catches the errors of the thread during its lifetime.
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

// The jump target of an error of the thread; nullptr outside of calls.
std::jmp_buf*& landing();
[[noreturn]] void throw_error();

// A function of MuJoCo that may fail. During the lifetime of a Catching an error is thrown as
// MujocoError.
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
    // _setjmp saves no signal mask: no system call.
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
