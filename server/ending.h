// The end of the process: by signals, and if memory is exhausted.
#pragma once

#include <csignal>
#include <exception>
#include <string_view>
#include <thread>

namespace isomesh {

// Blocks the signals that stop or reload the service, for this thread and those that it starts, and
// returns them. Ignores signals caused by writes, which then fail with an error.
sigset_t block_signals();

// Until the thread is stopped, SIGTERM or SIGINT ends the process with status 0. For a long start,
// such as waiting for a database, with nothing to drain yet.
std::jthread end_start_on_signal(sigset_t signals);

// The reason, if the system has no more memory or threads; otherwise empty. A null-terminated
// constant.
std::string_view shortage(const std::exception& error);

// From now on an uncaught exception of that kind ends the process with a message and status 1, not
// by a signal. Interrupted jobs run again at the next start.
void end_clearly_without_memory();

}  // namespace isomesh
