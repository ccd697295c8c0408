#include "client/cli/interrupt.h"

#include <csignal>

#include <pthread.h>
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

void wait_for_signals(const std::stop_token& over, std::stop_source& source) {
  const sigset_t signals = stop_signals();
  int signal = 0;
  while (::sigwait(&signals, &signal) == 0 && !over.stop_requested()) {
    if (!source.request_stop()) ::_exit(1);
  }
}

}  // namespace

Interrupt::Interrupt() {
  const sigset_t signals = stop_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ = std::jthread(
      [source = source_](const std::stop_token& over) mutable { wait_for_signals(over, source); });
}

Interrupt::~Interrupt() {
  waiter_.request_stop();
  // The signal ends the thread's wait. No other thread receives it.
  ::pthread_kill(waiter_.native_handle(), SIGINT);
}

}  // namespace isomesh::cli
