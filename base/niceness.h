// Who goes before whom where the processors are busy. Requests for what is there already are at 0:
// they take little, and somebody waits for each.
#pragma once

namespace isomesh {

// Of an upload's import, which its answer waits for.
inline constexpr int kImportNiceness = 3;
// Of answers that take long by their nature: lists, slices, histograms.
inline constexpr int kComputingNiceness = 7;
// Of meshes.
inline constexpr int kJobNiceness = 10;

// Makes the calling thread nicer by that, if by anything, and with it the threads and processes
// that it starts from now on, whose slices are the usual ones again. It cannot be undone. Thread
// safe.
void be_nicer(int by);

// Of a busy machine the calling thread, and the threads and processes that it starts from now on,
// get short slices, so that they wait less for whoever runs when they wake: for those who answer
// much and compute little. Linux 6.12 and later; before, and where the kernel refuses, it does
// nothing. Thread safe.
void be_prompt();

}  // namespace isomesh
