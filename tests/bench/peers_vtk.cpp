#include <stdexcept>
#include <vector>

#include <malloc.h>
#include <vtkCellArray.h>
#include <vtkDataArray.h>
#include <vtkDecimatePro.h>
#include <vtkDiscreteFlyingEdges3D.h>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPoints.h>
#include <vtkPolyData.h>
#include <vtkQuadricDecimation.h>
#include <vtkSmartPointer.h>
#include <vtkSmoothPolyDataFilter.h>
#include <vtkTypeInt32Array.h>
#include <vtkTypeInt64Array.h>
#include <vtkTypeTraits.h>
#include <vtkVersion.h>
#include <vtkWindowedSincPolyDataFilter.h>

#include "proto/samples.h"
#include "tests/bench/draco_call.h"
#include "tests/bench/peers.h"
#include "tests/bench/vtk_threads.h"

namespace isomesh::bench {
namespace {

int vtk_type(SampleType type) {
  return with_sample(type,
                     [](auto sample) { return vtkTypeTraits<decltype(sample)>::VTKTypeID(); });
}

// The samples as they are, without a copy.
vtkSmartPointer<vtkImageData> image_of(const Samples& samples) {
  auto image = vtkSmartPointer<vtkImageData>::New();
  image->SetDimensions(static_cast<int>(samples.dims.x), static_cast<int>(samples.dims.y),
                       static_cast<int>(samples.dims.z));
  image->SetSpacing(samples.geometry.spacing.data());
  image->SetOrigin(samples.geometry.origin.data());
  const auto scalars =
      vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(vtk_type(samples.type)));
  constexpr int kKeep = 1;  // VTK must not free what it does not own
  scalars->SetVoidArray(const_cast<std::byte*>(samples.bytes.data()),
                        static_cast<vtkIdType>(samples.dims.samples()), kKeep);
  image->GetPointData()->SetScalars(scalars);
  return image;
}

// The points and polygons alone: links that one filter left with its input would save the next one
// work.
vtkSmartPointer<vtkPolyData> bare(vtkPolyData* mesh) {
  auto result = vtkSmartPointer<vtkPolyData>::New();
  result->SetPoints(mesh->GetPoints());
  result->SetPolys(mesh->GetPolys());
  return result;
}

template <class Filter>
vtkSmartPointer<vtkPolyData> contour(vtkImageData* image, double iso) {
  const vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->SetValue(0, iso);
  filter->ComputeNormalsOff();
  filter->ComputeGradientsOff();
  filter->ComputeScalarsOff();
  filter->Update();
  return filter->GetOutput();
}

template <class Filter>
vtkSmartPointer<vtkPolyData> smoothed(vtkPolyData* mesh, int passes) {
  const vtkNew<Filter> filter;
  filter->SetInputData(bare(mesh));
  filter->SetNumberOfIterations(passes);
  filter->Update();
  return filter->GetOutput();
}

std::span<const mesh::Vec3> positions_of(vtkPolyData* mesh) {
  auto* points = vtkFloatArray::SafeDownCast(mesh->GetPoints()->GetData());
  if (points == nullptr) throw std::logic_error("VTK's points are not of single precision");
  return {reinterpret_cast<const mesh::Vec3*>(points->GetPointer(0)),
          static_cast<std::size_t>(points->GetNumberOfTuples())};
}

// Point ids of all triangles, three for each, one triangle after the other.
std::span<const long long> corners_of(vtkPolyData* mesh) {
  vtkCellArray* polys = mesh->GetPolys();
  if (!polys->IsStorage64Bit()) polys->ConvertTo64BitStorage();
  static_assert(sizeof(long long) == sizeof(vtkTypeInt64));
  const auto* corners = polys->GetConnectivityArray64();
  return {reinterpret_cast<const long long*>(
              const_cast<vtkCellArray::ArrayType64*>(corners)->GetPointer(0)),
          static_cast<std::size_t>(polys->GetNumberOfConnectivityIds())};
}

std::uint64_t draco_of(vtkPolyData* mesh) {
  return encode_in_one_call(positions_of(mesh), corners_of(mesh));
}

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

struct Peers::Vtk {
  vtkSmartPointer<vtkImageData> image;
  double iso = 0;
  vtkSmartPointer<vtkPolyData> mesh;   // the last Flying Edges mesh
  vtkSmartPointer<vtkPolyData> other;  // what came from it, or another surface
  std::vector<vtkSmartPointer<vtkPolyData>> labels;
};

bool peers_available() { return true; }

std::string peers_description() {
  return std::string("VTK ") + vtkVersion::GetVTKVersion() + " with its SMP backend " +
         vtk_backend();
}

Peers::Peers(const Samples& samples, double iso)
    : vtk_(std::make_unique<Vtk>(Vtk{image_of(samples), iso, nullptr, nullptr, {}})) {}

Peers::~Peers() = default;

void Peers::set_threads(int threads) { set_vtk_threads(threads); }

void Peers::flying_edges() { vtk_->mesh = contour<vtkFlyingEdges3D>(vtk_->image, vtk_->iso); }

void Peers::discrete_flying_edges(std::span<const std::int64_t> labels) {
  vtk_->labels.clear();
  for (const std::int64_t label : labels) {
    vtk_->labels.push_back(
        contour<vtkDiscreteFlyingEdges3D>(vtk_->image, static_cast<double>(label)));
  }
}

void Peers::smooth_labels() {
  constexpr int kPasses = 15;
  constexpr double kPassBand = 0.001;
  for (auto& mesh : vtk_->labels) {
    const vtkNew<vtkWindowedSincPolyDataFilter> filter;
    filter->SetInputData(bare(mesh));
    filter->SetNumberOfIterations(kPasses);
    filter->SetPassBand(kPassBand);
    filter->BoundarySmoothingOff();
    filter->FeatureEdgeSmoothingOff();
    filter->NonManifoldSmoothingOn();
    filter->NormalizeCoordinatesOn();
    filter->Update();
    mesh = filter->GetOutput();
  }
}

void Peers::smooth(int passes) {
  vtk_->other = smoothed<vtkSmoothPolyDataFilter>(vtk_->mesh, passes);
}

void Peers::windowed_sinc(int passes) {
  vtk_->other = smoothed<vtkWindowedSincPolyDataFilter>(vtk_->mesh, passes);
}

std::uint64_t Peers::draco() const { return draco_of(vtk_->mesh); }

std::uint64_t Peers::pipeline() {
  flying_edges();
  windowed_sinc(kPeerSincPasses);
  return draco_of(vtk_->other);
}

void Peers::release() {
  vtk_->mesh = nullptr;
  vtk_->other = nullptr;
  vtk_->labels.clear();
  malloc_trim(0);
}

MeshSize Peers::size() const {
  return {static_cast<std::uint64_t>(vtk_->mesh->GetNumberOfPoints()),
          static_cast<std::uint64_t>(vtk_->mesh->GetNumberOfPolys())};
}

std::vector<DecimationPeer> decimation_peers() {
  return {{"vtkQuadricDecimation", quadric}, {"vtkDecimatePro", pro}};
}

}  // namespace isomesh::bench
