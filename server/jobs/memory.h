#pragma once

namespace isomesh::jobs {

// Makes the process's allocator keep what is freed instead of giving it back to the system.
// Encoders take and give back megabytes thousands of times a second, and by default each such block
// comes fresh from the kernel, which clears its pages anew: a seventh of the encoding time went
// there. To be called once, before threads start; what stays is bounded.
void keep_freed_memory();

}  // namespace isomesh::jobs
