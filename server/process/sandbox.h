// Restricts the calling process to the needs of reading one untrusted file. It cannot be undone.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>

#include "base/descriptor.h"

namespace isomesh::process {

struct Confinement {
  std::filesystem::path readable;  // the only readable file
  std::filesystem::path writable;  // the only folder with full access
  // Private memory only: the canonical file is mapped, and may be larger than the memory.
  std::uint64_t memory_bytes = 0;
  std::uint64_t file_bytes = 0;  // of each file, and of all mapped files together
  std::chrono::seconds time{0};  // CPU time; is_out_of_time() tells that it was used up
};

// Drops all rights that are not needed before the process knows its input. It cannot gain
// privileges, write core dumps, open many files or sockets, start programs or processes or signal
// others, and the kernel kills it first if memory runs out. Works without privileges and as root.
//
// Throws Error kInternal if the kernel refuses. Call once, before a second thread is started.
void confine_ahead();

// The same for a process that also uses its existing sockets; it creates and connects none.
void confine_ahead_to_talk();

// Drops the remaining rights: limits memory, CPU time and file sizes. Landlock, if the kernel has
// it, denies all other files. None of this can be changed afterwards. Requires one of the two
// above. Call once. Throws as they do; a kernel without Landlock is not an error.
void confine_to(const Confinement& confinement);

// Confines a long-running process with threads. It may open no files, write at most so much to each
// that it has open, and has no capabilities even as root. It has the calls of confine_ahead(),
// those that create threads, and those that receive descriptors, its only input. Throws as that
// does. Call once, before a second thread is started, and instead of the functions above.
void confine_job(std::uint64_t file_bytes = 0);

// Limits the process's memory (RLIMIT_DATA) repeatedly. All of its memory is private: a confined
// process cannot map memory that this limit does not count. Construct it before the process is
// confined. Not thread safe.
class MemoryLimit {
 public:
  // The process can never have more than `most_more_bytes` beside what it uses now. Throws Error
  // kInternal, as set() does.
  explicit MemoryLimit(std::uint64_t most_more_bytes);

  // Allows the process that many bytes more than it uses now, up to the most.
  void set(std::uint64_t more_bytes) const;

 private:
  std::uint64_t with_present(std::uint64_t more_bytes) const;

  Descriptor usage_;  // a confined process could not open it
};

// True if the kernel can deny access to other files. Thread safe.
bool has_landlock();

}  // namespace isomesh::process
