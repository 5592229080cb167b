# Sanitizers of the native targets. -DTAUGUARD_SANITIZE=address: AddressSanitizer and
# UndefinedBehaviorSanitizer; =thread: ThreadSanitizer; =fuzzer (Clang only): libFuzzer with the first two.
set(TAUGUARD_SANITIZE "" CACHE STRING "address (and undefined behaviour), thread or fuzzer; empty: none")

function(tauguard_sanitize target)
  if(TAUGUARD_SANITIZE STREQUAL "address")
    set(flags -fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=undefined,float-cast-overflow
        -fno-omit-frame-pointer)
  elseif(TAUGUARD_SANITIZE STREQUAL "fuzzer")
    set(flags -fsanitize=fuzzer,address,undefined -fno-sanitize-recover=undefined)
  elseif(TAUGUARD_SANITIZE STREQUAL "thread")
    set(flags -fsanitize=thread)
  elseif(TAUGUARD_SANITIZE)
    message(FATAL_ERROR "TAUGUARD_SANITIZE: ${TAUGUARD_SANITIZE}, expected address, thread or fuzzer")
  else()
    return()
  endif()
  target_compile_options(${target} PRIVATE ${flags})
  target_link_options(${target} PRIVATE ${flags})
endfunction()
