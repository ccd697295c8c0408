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

// What can be taken from a process before it is known what it is to read. It cannot gain rights,
// make core dumps, open many files or sockets, start programs or processes or signal others, and
// the kernel ends it first when memory runs out. Works without privileges and as root.
//
// Throws Error kInternal when the kernel refuses any of this. Must be called before a second thread
// is started, once.
void confine_ahead();

// Takes the rest: limits memory, time and the size of files; Landlock, where the kernel has it,
// keeps the process from all files but those; nothing of this can be changed any more. Needs
// confine_ahead(), once. Throws as that does; a kernel without Landlock is no error.
void confine_to(const Confinement& confinement);

// Confines a process that works for long, with threads: it may read below one folder and do
// anything below another, and has the calls of confine_ahead() and those that make threads. Throws
// as that does. Must be called before a second thread is started, once, and instead of the two
// above.
void confine_job(const std::filesystem::path& readable, const std::filesystem::path& writable);

// From now on the process's private memory is at most so many bytes more than it is. May be called
// again and again.
void limit_memory(std::uint64_t more_bytes);

// Whether the kernel can keep a process from other files. Thread safe.
bool has_landlock();

}  // namespace isomesh::process
