// The alternatives to isomesh: VTK's filters, and Draco in one call. In a program built without VTK
// the class exists, but its constructor throws.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "server/mesh/measure/surface_view.h"
#include "tests/bench/samples.h"
#include "tests/bench/stages.h"

namespace isomesh::bench {

inline constexpr int kPeerSincPasses = 20;  // the filter's own default

// peers_available() is true if the program was built with VTK. The description names the peers or
// says why they are missing.
bool peers_available();
std::string peers_description();

// VTK on one volume. Filters are made anew for every run, because they would return what they have
// cached; normals, gradients and scalars are off, because isomesh makes none. Not thread safe.
// Keeps a reference to the samples.
class Peers {
 public:
  // Throws std::logic_error when there are none.
  Peers(const Samples& samples, double iso);
  ~Peers();
  Peers(const Peers&) = delete;
  Peers& operator=(const Peers&) = delete;

  // Threads of all peers; of VTK's SMP backend, which is TBB where VTK has it.
  static void set_threads(int threads);

  void flying_edges();
  // One run a label, of which all meshes are kept.
  void discrete_flying_edges(std::span<const std::int64_t> labels);
  // Smooths each of them by itself as VTK's example GenerateModelsFromLabels does:
  // vtkWindowedSincPolyDataFilter with 15 passes and a pass band of 0.001, coordinates normalised.
  void smooth_labels();
  // These take the last Flying Edges mesh, which they keep.
  void smooth(int passes);         // vtkSmoothPolyDataFilter
  void windowed_sinc(int passes);  // vtkWindowedSincPolyDataFilter
  std::uint64_t draco() const;     // edgebreaker, 14 bits, speed 5; the number of bytes
  // Flying Edges, windowed sinc and Draco; the number of bytes.
  std::uint64_t pipeline();

  // Frees all outputs, so that freeing is not in the next run's time.
  void release();
  MeshSize size() const;  // of the last Flying Edges mesh

 private:
  struct Vtk;
  std::unique_ptr<Vtk> vtk_;
};

// A mesh that another program has simplified.
struct Decimated {
  std::vector<mesh::Vec3> positions;
  std::vector<mesh::Triangle> triangles;
};

struct DecimationPeer {
  std::string name;
  // To about that many triangles; `run` is all that is timed.
  Decimated (*run)(const mesh::SurfaceView& surface, std::size_t triangles);
};

// Those of VTK; none without it.
std::vector<DecimationPeer> decimation_peers();

}  // namespace isomesh::bench
