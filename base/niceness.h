// CPU priorities. Requests for existing data run at niceness 0: they are cheap, and a client waits
// for each.
#pragma once

namespace isomesh {

// For imports: the upload's response waits for them.
inline constexpr int kImportNiceness = 3;
// For expensive responses: lists, slices, histograms.
inline constexpr int kComputingNiceness = 7;
// For mesh jobs.
inline constexpr int kJobNiceness = 10;

// Raises the niceness of the calling thread and of the threads and processes that it starts later,
// and resets their time slices. Does nothing for 0. Cannot be undone. Thread safe.
void be_nicer(int by);

// Shortens the time slices of the calling thread and of the threads and processes that it starts
// later, so that they wake up faster on a busy machine. For threads that respond often and compute
// little. Needs Linux 6.12; does nothing on older kernels or if the kernel refuses. Thread safe.
void be_prompt();

}  // namespace isomesh
