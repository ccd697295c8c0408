// isomesh: the command-line client.

#include <atomic>
#include <csignal>
#include <exception>
#include <iostream>
#include <stop_token>
#include <thread>
#include <utility>

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "client/cli/commands.h"
#include "client/cli/console.h"
#include "client/cli/exit_status.h"
#include "client/cli/options.h"
#include "client/mcp/command.h"
#include "client/platforms/command.h"
#include "server/hospital/command/orders.h"

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

// Ctrl-C as a stop request instead of an immediate end. Construct it first in main, while only one
// thread runs: it blocks SIGINT, SIGTERM and SIGHUP, unless that is ignored, for all threads and
// waits for them on a thread of its own. The first signal requests a stop; a second one, except
// SIGHUP, ends the process immediately, by that signal.
class Interrupt {
 public:
  Interrupt() {
    const sigset_t signals = stop_signals();
    ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    waiter_ = std::jthread(
        [this](const std::stop_token& over) { wait_for_signals(over, source_, signal_); });
  }
  ~Interrupt() {
    waiter_.request_stop();
    // The signal ends the thread's wait. No other thread receives it.
    ::pthread_kill(waiter_.native_handle(), SIGINT);
  }
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  std::stop_token token() const { return source_.get_token(); }

  // Ends the process by the received signal, with its default action; returns if there was none. A
  // shell ends its loop only if the command has died by SIGINT.
  void end_by_signal() const {
    if (signal_ != 0) die_by(signal_);
  }

 private:
  std::stop_source source_;
  std::atomic<int> signal_ = 0;
  std::jthread waiter_;
};

// True if the reader of the output has ended, for example `head`. That is not an error to report.
bool reader_has_left() {
  pollfd output{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
  return ::poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0;
}

}  // namespace

int main(int argc, char** argv) {
  using namespace isomesh::cli;
  isomesh::hold_standard_descriptors();
  // If the reader of the output ends, writing fails instead of ending the process.
  std::signal(SIGPIPE, SIG_IGN);
  // The same for a file beyond `ulimit -f`, so that the unfinished file is removed.
  std::signal(SIGXFSZ, SIG_IGN);
  const Interrupt interrupt;
  int status = kRefused;
  try {
    Added added = order_commands();
    for (Added more : {mcp_commands(), platform_commands()}) {
      for (AddedCommand& each : more.commands) added.commands.push_back(std::move(each));
    }
    status = run(parse_options(argc, argv, added), interrupt.token());
  } catch (const EarlyExit& exit) {
    (exit.status() == 0 ? std::cout : std::cerr) << exit.what();
    status = exit.status();
  } catch (const std::exception& error) {
    complain(error.what());
  }
  std::cout.flush();
  interrupt.end_by_signal();
  if (std::cout || status != kDone) return status;
  if (!reader_has_left()) std::cerr << "isomesh: standard output cannot be written to\n";
  return kRefused;
}
