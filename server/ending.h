// How the process ends: by signals, and for want of memory.
#pragma once

#include <csignal>
#include <exception>
#include <string_view>
#include <thread>

namespace isomesh {

// Blocks the signals that end or reload the service, for this thread and those that it starts, and
// returns them. Ignores those that a write may cause, which reports an error instead.
sigset_t block_signals();

// Ends the process with status 0 at SIGTERM or SIGINT until the thread is stopped. A start may take
// long, as when it waits for a database, and has nothing yet that would have to be drained.
std::jthread end_start_on_signal(sigset_t signals);

// The reason, if the error says that the system gives no more memory or threads; else empty. A
// null-terminated constant.
std::string_view shortage(const std::exception& error);

// An exception of that kind that nothing catches ends the process with a message and status 1 from
// now on, not by a signal. Jobs that were running are run again at the next start.
void end_clearly_without_memory();

}  // namespace isomesh
