#pragma once

#include <cstdint>
#include <filesystem>

namespace isomesh::jobs {

// Makes the process's allocator keep what is freed instead of giving it back to the system.
// Encoders take and give back megabytes thousands of times a second, and by default each such block
// comes fresh from the kernel, which clears its pages anew: a seventh of the encoding time went
// there. To be called once, before threads start; what stays is bounded.
void keep_freed_memory();

// The memory that this process may use, in bytes: the machine's, or what its control group (version
// 2 or 1) or one above it allows, whichever is least. `root` is the folder that /proc and /sys are
// in.
std::uint64_t usable_memory(const std::filesystem::path& root = "/");

}  // namespace isomesh::jobs
