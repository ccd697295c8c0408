// Confines the calling process to what reading one untrusted file needs. A confined process cannot
// undo it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>

namespace isomesh::process {

struct Confinement {
  std::filesystem::path readable;  // the one file that may be read
  std::filesystem::path writable;  // the one folder in which anything may be done
  std::uint64_t memory_bytes = 0;  // of private memory
  std::uint64_t file_bytes = 0;    // of any one file, and of those that are mapped together
  std::chrono::seconds time{0};    // of the processor
};

// Limits the memory, the time, the open files and the size of files, and forbids core dumps. After
// that, seccomp lets the process open no socket, start no program and signal no other process, and
// Landlock, where the kernel has it, keeps it from all other files. It cannot gain rights, and the
// kernel ends it first when memory runs out. Works without privileges and as root.
//
// Throws Error kInternal when the kernel refuses any of this; a kernel without Landlock is no
// error. Must be called before a second thread is started.
void confine(const Confinement& confinement);

// Whether the kernel can keep a process from other files. Thread safe.
bool has_landlock();

}  // namespace isomesh::process
