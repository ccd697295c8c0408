#include "client/cli/interrupt.h"

#include <csignal>

#include <pthread.h>
#include <time.h>
#include <unistd.h>

namespace isomesh::cli {
namespace {

sigset_t stop_signals() {
  sigset_t signals{};
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

void wait_for_signals(const std::stop_token& over, std::stop_source source) {
  const sigset_t signals = stop_signals();
  constexpr timespec kLook{.tv_sec = 0, .tv_nsec = 20'000'000};
  while (!over.stop_requested()) {
    if (::sigtimedwait(&signals, nullptr, &kLook) < 0) continue;
    if (!source.request_stop()) ::_exit(1);
  }
}

}  // namespace

Interrupt::Interrupt() {
  const sigset_t signals = stop_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ = std::jthread(
      [source = source_](const std::stop_token& over) { wait_for_signals(over, source); });
}

}  // namespace isomesh::cli
