// Confines the calling process to what reading one untrusted file needs. A confined process cannot
// undo it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>

#include "base/descriptor.h"

namespace isomesh::process {

struct Confinement {
  std::filesystem::path readable;  // the one file that may be read
  std::filesystem::path writable;  // the one folder in which anything may be done
  // Private memory only: the canonical file is mapped, and may be larger than the memory.
  std::uint64_t memory_bytes = 0;
  std::uint64_t file_bytes = 0;  // of any one file, and of those that are mapped together
  std::chrono::seconds time{0};  // of the processor
};

// What can be taken from a process before it is known what it is to read. It cannot gain rights,
// make core dumps, open many files or sockets, start programs or processes or signal others, and
// the kernel ends it first when memory runs out. Works without privileges and as root.
//
// Throws Error kInternal when the kernel refuses any of this. Must be called before a second thread
// is started, once.
void confine_ahead();

// The same for a process that also talks over the sockets that it has; it makes none and connects
// none.
void confine_ahead_to_talk();

// Takes the rest: limits memory, time and the size of files; Landlock, where the kernel has it,
// keeps the process from all files but those; nothing of this can be changed any more. Needs
// one of the two above, once. Throws as that does; a kernel without Landlock is no error.
void confine_to(const Confinement& confinement);

// Confines a process that works for long, with threads: it may open no file at all and write
// nothing, and has the calls of confine_ahead() and those that make threads or receive descriptors,
// which are all that it can read. Throws as that does. Must be called before a second thread is
// started, once, and instead of those above.
void confine_job();

// Limits the process's private memory (RLIMIT_DATA), again and again. To be made before the process
// is confined. Not thread safe.
class MemoryLimit {
 public:
  // Throws Error kInternal, as set() does.
  MemoryLimit();

  // From now on the process has at most so many bytes more than it has.
  void set(std::uint64_t more_bytes) const;

 private:
  Descriptor usage_;  // a confined process could not open it any more
};

// Whether the kernel can keep a process from other files. Thread safe.
bool has_landlock();

}  // namespace isomesh::process
