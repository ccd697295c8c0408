// A program that is started once, gets itself ready, and from then on makes copies of itself, which
// takes a fraction of the time. It does nothing else and reads nobody's bytes, so each copy is as
// untouched as a program that has just been started.
#pragma once

#include <functional>
#include <stop_token>

#include "server/process/child.h"

namespace isomesh::process {

// The side of the program: serves the socket kChildDescriptor until its other end is closed, and
// ends the process then. `work` runs in each copy, which ends after it; the copy's
// kChildDescriptor is a socket of its own, it is nicer by kImportNiceness (base/niceness.h), and it
// dies with the daemon. Needs a process with one thread, which start_program has started.
[[noreturn]] void serve_copies(const std::function<void()>& work);

// The side of the daemon: a copy, which is a child of this process, not of `server`. The thread
// that started `server` must outlive the copy, because that dies with it. Throws Error kInternal
// when the server does not answer, kUnavailable when `stop` is requested.
Child copy_of(const Child& server, const std::stop_token& stop);

}  // namespace isomesh::process
