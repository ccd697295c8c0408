// A program that is started and initialised once, and then forks copies of itself, which is much
// faster. It does nothing else and reads no untrusted bytes, so each copy is as clean as a new
// process.
#pragma once

#include <functional>
#include <stop_token>

#include "server/process/child.h"

namespace isomesh::process {

// The program's side: serves the socket kChildDescriptor until its peer closes, then ends the
// process. `work` runs in each copy, which ends afterwards. The copy has its own socket as
// kChildDescriptor, has its niceness raised by kImportNiceness (base/niceness.h), and dies with the
// daemon. Requires a single-threaded process started by start_program.
[[noreturn]] void serve_copies(const std::function<void()>& work);

// The daemon's side: a copy, which is a child of this process, not of `server`. The thread that
// started `server` must outlive the copy, which dies with that thread. Throws Error kInternal if
// the server does not respond, kUnavailable if `stop` is requested.
Child copy_of(const Child& server, const std::stop_token& stop);

}  // namespace isomesh::process
