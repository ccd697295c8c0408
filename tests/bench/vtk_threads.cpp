#include "tests/bench/vtk_threads.h"

#include <vtkSMPTools.h>

namespace isomesh::bench {

void set_vtk_threads(int threads) {
  vtkSMPTools::SetBackend("TBB");
  vtkSMPTools::Initialize(threads);
}

const char* vtk_backend() { return vtkSMPTools::GetBackend(); }

}  // namespace isomesh::bench
