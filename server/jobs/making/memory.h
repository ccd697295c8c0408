#pragma once

#include <cstdint>
#include <filesystem>

namespace isomesh::jobs {

// Makes the process's allocator keep freed memory instead of returning it to the system. Encoders
// allocate and free megabytes thousands of times a second. By default each such block comes from
// the kernel, which clears its pages: a seventh of the encoding time. Call once, before threads
// start. What is kept is bounded.
void keep_freed_memory();

// Returns what is kept all the same, between parts of a job that use blocks of other sizes.
void give_back_freed_memory();

// The memory that this process may use, in bytes: the least of the machine's and the limits of its
// control group (version 2 or 1) and those above. `root` is the folder that contains /proc and
// /sys.
std::uint64_t usable_memory(const std::filesystem::path& root = "/");

}  // namespace isomesh::jobs
