#include <vtkCellArray.h>
#include <vtkDecimatePro.h>
#include <vtkFloatArray.h>
#include <vtkNew.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkQuadricDecimation.h>

#include "tests/bench/peers.h"

namespace isomesh::bench {
namespace {

vtkSmartPointer<vtkPolyData> to_vtk(const mesh::SurfaceView& surface) {
  const vtkNew<vtkPoints> points;
  points->SetDataTypeToFloat();
  points->SetNumberOfPoints(static_cast<vtkIdType>(surface.positions.size()));
  for (std::size_t v = 0; v < surface.positions.size(); ++v) {
    points->SetPoint(static_cast<vtkIdType>(v), surface.positions[v].data());
  }
  const vtkNew<vtkCellArray> polys;
  for (const auto& [a, b, c] : surface.triangles) {
    const vtkIdType corners[] = {a, b, c};
    polys->InsertNextCell(3, corners);
  }
  auto result = vtkSmartPointer<vtkPolyData>::New();
  result->SetPoints(points);
  result->SetPolys(polys);
  return result;
}

Decimated from_vtk(vtkPolyData* data) {
  Decimated result;
  for (vtkIdType v = 0; v < data->GetNumberOfPoints(); ++v) {
    const double* at = data->GetPoint(v);
    result.positions.push_back(
        {static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])});
  }
  vtkCellArray* polys = data->GetPolys();
  polys->InitTraversal();
  vtkIdType count = 0;
  const vtkIdType* corners = nullptr;
  while (polys->GetNextCell(count, corners) != 0) {
    if (count != 3) continue;  // lines that a decimation may leave are no surface
    result.triangles.push_back({static_cast<std::uint32_t>(corners[0]),
                                static_cast<std::uint32_t>(corners[1]),
                                static_cast<std::uint32_t>(corners[2])});
  }
  return result;
}

double reduction(const mesh::SurfaceView& surface, std::size_t triangles) {
  return 1 - static_cast<double>(triangles) / static_cast<double>(surface.triangles.size());
}

Decimated quadric(const mesh::SurfaceView& surface, std::size_t triangles) {
  const vtkNew<vtkQuadricDecimation> filter;
  filter->SetInputData(to_vtk(surface));
  filter->SetTargetReduction(reduction(surface, triangles));
  filter->Update();
  return from_vtk(filter->GetOutput());
}

Decimated pro(const mesh::SurfaceView& surface, std::size_t triangles) {
  const vtkNew<vtkDecimatePro> filter;
  filter->SetInputData(to_vtk(surface));
  filter->SetTargetReduction(reduction(surface, triangles));
  filter->PreserveTopologyOn();
  filter->Update();
  return from_vtk(filter->GetOutput());
}

}  // namespace

std::vector<DecimationPeer> decimation_peers() {
  return {{"vtkQuadricDecimation", quadric}, {"vtkDecimatePro", pro}};
}

}  // namespace isomesh::bench
