#include "caught.hpp"

#include <cstring>

namespace tauguard::contacts {
namespace {

constexpr std::size_t longest = 1024;

thread_local std::jmp_buf* jump = nullptr;
thread_local const Logging* logging = nullptr;
thread_local Logging::Handler before = nullptr;
thread_local char text[longest];

void handle(const void* message) {
  int level;
  std::memcpy(&level, message, sizeof level);
  if (level == logging->error && jump) {
    std::strncpy(text, static_cast<const char*>(message) + logging->at_subject, longest - 1);
    std::longjmp(*jump, 1);
  }
  const Logging::Handler other = before ? before : logging->global();
  if (other) other(message);
}

}  // namespace

Catching::Catching(const Logging& own)
    : logging_(own), outer_(logging), before_(nullptr), outer_before_(before) {
  if (!own.set) return;
  logging = &logging_;
  before = before_ = own.set(&handle);
}

Catching::~Catching() {
  if (!logging_.set) return;
  logging_.set(before_);
  logging = outer_, before = outer_before_;
}

std::jmp_buf*& landing() { return jump; }

void throw_error() { throw MujocoError(text); }

}  // namespace tauguard::contacts
