// The process that imports for a daemon: the daemon's own program, started again by
// import_runner.h.
#pragma once

namespace isomesh::volume {

// To be called first in main(), before anything is started or read: when the program was started to
// import, this does so and ends the process. Otherwise returns, and the program is from then on one
// that an ImportRunner can start.
void become_import_worker_if_asked(int argc, const char* const* argv);

// Whether the program has called it.
bool can_become_import_worker();

// How a program is asked: its first argument, and a descriptor that is both pipe and answer.
inline constexpr const char* kImportWorkerArgument = "import-worker";
inline constexpr int kImportWorkerDescriptor = 3;

}  // namespace isomesh::volume
