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

// Makes the calling thread nicer by that, and with it the threads and processes that it starts from
// now on. It cannot be undone. Thread safe.
void be_nicer(int by);

}  // namespace isomesh
