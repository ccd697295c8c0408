#include "server/ending.h"

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <new>
#include <system_error>

#include "base/log.h"

namespace isomesh {
namespace {

// Constant once end_clearly_without_memory() has returned.
std::terminate_handler default_terminate = nullptr;

[[noreturn]] void end_by_exception() {
  try {
    if (const std::exception_ptr current = std::current_exception()) {
      std::rethrow_exception(current);
    }
  } catch (const std::exception& error) {
    if (const std::string_view reason = shortage(error); !reason.empty()) {
      std::fprintf(stderr, "isomeshd: %s\n", reason.data());  // allocates nothing
      std::_Exit(EXIT_FAILURE);
    }
  } catch (...) {  // a bug, like all others: the core dump has its place
  }
  default_terminate();
  std::abort();
}

}  // namespace

sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // makes the file size limit an error like a full disk
  return signals;
}

std::jthread end_start_on_signal(sigset_t signals) {
  sigdelset(&signals, SIGHUP);
  return std::jthread([signals](const std::stop_token& stop) {
    constexpr timespec kBetweenLooks = {.tv_sec = 0, .tv_nsec = 10'000'000};
    while (!stop.stop_requested()) {
      const int signal = ::sigtimedwait(&signals, nullptr, &kBetweenLooks);
      if (signal <= 0) continue;
      log_info("signal {}: the start is abandoned", signal);
      std::_Exit(EXIT_SUCCESS);
    }
  });
}

std::string_view shortage(const std::exception& error) {
  if (dynamic_cast<const std::bad_alloc*>(&error) != nullptr) {
    return "there is not enough memory for the service (see its limits, such as ulimit -v)";
  }
  const auto* const failed = dynamic_cast<const std::system_error*>(&error);
  if (failed != nullptr && failed->code() == std::errc::resource_unavailable_try_again) {
    return "there is not enough memory for another thread, or there are too many of them (see "
           "ulimit -v and -u)";
  }
  return {};
}

void end_clearly_without_memory() { default_terminate = std::set_terminate(end_by_exception); }

}  // namespace isomesh
