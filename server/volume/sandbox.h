// Takes from the calling process what reading an untrusted file does not need. For good: there is
// no way back.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>

namespace isomesh::volume {

struct Confinement {
  std::filesystem::path readable;  // the one file that may be read
  std::filesystem::path writable;  // the one folder in which anything may be done
  std::uint64_t memory_bytes = 0;  // of private memory
  std::uint64_t file_bytes = 0;    // of any one file, and of those that are mapped together
  std::chrono::seconds time{0};    // of the processor
};

// Memory, time, open files, the size of files and core dumps are limited; no sockets, no programs,
// no other processes (seccomp); no other files where the kernel has Landlock; no rights to be
// gained; the process dies with the one that started it, and is the kernel's first choice when
// memory runs out. Works without privileges and as root.
// Throws Error kInternal when the kernel refuses any of it but Landlock, which may be missing.
// To be called before there is a second thread.
void confine(const Confinement& confinement);

// Whether the kernel can keep a process from other files. Thread safe.
bool has_landlock();

}  // namespace isomesh::volume
