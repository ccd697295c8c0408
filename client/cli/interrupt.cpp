#include "client/cli/interrupt.h"

#include <csignal>

#include <pthread.h>

namespace isomesh::cli {
namespace {

sigset_t stop_signals() {
  sigset_t signals{};
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  struct sigaction hangup = {};
  const bool is_known = ::sigaction(SIGHUP, nullptr, &hangup) == 0;
  // nohup: the command goes on without its terminal.
  if (is_known && hangup.sa_handler != SIG_IGN) sigaddset(&signals, SIGHUP);
  return signals;
}

void die_by(int signal) {
  std::signal(signal, SIG_DFL);
  sigset_t own{};
  sigemptyset(&own);
  sigaddset(&own, signal);
  ::pthread_sigmask(SIG_UNBLOCK, &own, nullptr);
  std::raise(signal);
}

void wait_for_signals(const std::stop_token& over, std::stop_source& source,
                      std::atomic<int>& first) {
  const sigset_t signals = stop_signals();
  int signal = 0;
  while (::sigwait(&signals, &signal) == 0 && !over.stop_requested()) {
    // A terminal that is closed sends SIGHUP, and then its shell does, too.
    if (first != 0 && signal == SIGHUP) continue;
    if (first != 0) die_by(signal);
    first = signal;
    source.request_stop();
  }
}

}  // namespace

Interrupt::Interrupt() {
  const sigset_t signals = stop_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  waiter_ = std::jthread(
      [this](const std::stop_token& over) { wait_for_signals(over, source_, signal_); });
}

Interrupt::~Interrupt() {
  waiter_.request_stop();
  // The signal ends the thread's wait. No other thread receives it.
  ::pthread_kill(waiter_.native_handle(), SIGINT);
}

void Interrupt::end_by_signal() const {
  if (signal_ != 0) die_by(signal_);
}

}  // namespace isomesh::cli
