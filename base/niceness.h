// Who goes before whom where the processors are busy. Requests for what is there already are at 0:
// they take little, and somebody waits for each.
#pragma once

namespace isomesh {

// Of an upload's import, which its answer waits for.
inline constexpr int kImportNiceness = 5;
// Of what takes long by its nature: meshes, and answers that are computed.
inline constexpr int kComputingNiceness = 10;

// Makes the calling thread nicer by that, and with it the threads and processes that it starts from
// now on. It cannot be undone. Thread safe.
void be_nicer(int by);

}  // namespace isomesh
