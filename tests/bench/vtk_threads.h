// The threads of VTK's filters. Apart from peers_vtk.cpp because the header behind it is not C++20.
#pragma once

namespace isomesh::bench {

// Takes the backend TBB where VTK has it. Not while a filter runs.
void set_vtk_threads(int threads);
const char* vtk_backend();

}  // namespace isomesh::bench
