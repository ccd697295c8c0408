#include "server/jobs/making/walk_stage.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "proto/samples.h"
#include "server/codec/facet_file.h"
#include "server/jobs/making/memory.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/mesh_stages.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/measure/shapes.h"
#include "server/mesh/parallel.h"
#include "server/mesh/topology/window_topology.h"
#include "server/mesh/walk/walk.h"

namespace isomesh::jobs {
namespace {

constexpr std::uint64_t kFewSamples = std::uint64_t{1} << 22;

// Writes files of facets, and measures the surface.
class FacetFiles : public mesh::WindowUser {
 public:
  FacetFiles(const MeshRequest& request, std::span<const codec::Sink> sinks,
             const mesh::SurfaceSize& surface, mesh::Context quiet)
      : parameters_(request.parameters),
        quiet_(std::move(quiet)),
        extracted_(surface.triangles),
        final_(surface.triangles) {
    const LengthUnit unit = length_unit(notes_in_mesh(request.volume.notes));
    const std::vector<MeshFormat> formats = files_of(parameters_);
    for (std::size_t i = 0; i < formats.size(); ++i) {
      const File file = {codec::facet_file_of(formats[i]), space_of(formats[i], parameters_),
                         &sinks[i]};
      sinks[i](file.format->head(file.space, unit, surface.triangles));
      files_.push_back(file);
    }
  }

  void see_extracted(const mesh::Mesh& mesh, std::size_t begin, std::size_t end) override {
    extracted_.add(mesh, begin, end);
  }

  std::size_t begin(const mesh::Window& window) override {
    const std::size_t triangles = window.mesh.triangles.size();
    if (parameters_.passes > 0) final_.add(window.mesh, 0, triangles);
    return 1 + chunks_of(triangles) * files_.size();
  }

  InOrder work(const mesh::Window& window, std::size_t part) override {
    if (part == 0) {
      const auto found = std::make_shared<mesh::WindowTopology>(window.mesh, window.below, quiet_);
      return [this, found] { topology_.add(*found); };
    }
    const std::size_t chunks = chunks_of(window.mesh.triangles.size());
    const File& file = files_[(part - 1) / chunks];
    const std::size_t begin = (part - 1) % chunks * kTrianglesPerChunk;
    const std::size_t end = std::min(window.mesh.triangles.size(), begin + kTrianglesPerChunk);
    const auto bytes = std::make_shared<std::vector<std::byte>>(take());
    bytes->resize((end - begin) * file.format->facet_bytes);
    file.format->write(window.mesh, file.space, begin, end, bytes->data());
    return [this, &file, bytes] {
      (*file.sink)(*bytes);
      give_back(std::move(*bytes));
    };
  }

  void set_measures(const mesh::SmoothingEffect& effect, const mesh::SurfaceSize& surface,
                    MeshSummary& summary) const {
    set_smoothing(extracted_.result(), effect, summary);
    if (parameters_.passes > 0) set_final(final_.result(), summary.quality);
    set_size(surface, summary);
    set_topology(topology_.result(surface.vertices, surface.triangles), summary);
  }

 private:
  static constexpr std::size_t kTrianglesPerChunk = 1 << 15;

  struct File {
    const codec::FacetFile* format;
    Space space;
    const codec::Sink* sink;
  };

  static std::size_t chunks_of(std::size_t triangles) {
    return mesh::chunks_of(triangles, kTrianglesPerChunk);
  }

  // Bytes are used again, so that their pages stay mapped.
  std::vector<std::byte> take() {
    const Lock lock(mutex_);
    if (idle_.empty()) return {};
    std::vector<std::byte> bytes = std::move(idle_.back());
    idle_.pop_back();
    return bytes;
  }
  void give_back(std::vector<std::byte> bytes) {
    const Lock lock(mutex_);
    idle_.push_back(std::move(bytes));
  }

  const MeshParameters& parameters_;
  const mesh::Context quiet_;
  std::vector<File> files_;
  mesh::ShapesSum extracted_;
  mesh::ShapesSum final_;
  mesh::TopologySum topology_;
  Mutex mutex_;
  std::vector<std::vector<std::byte>> idle_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace

MeshSummary walk_stage(const SampleArray& samples, const MeshRequest& request,
                       std::span<const codec::Sink> sinks, Progress& progress) {
  MeshSummary summary;
  summary.iso = request.iso;
  progress.enter(Stage::kExtract);
  const mesh::ExtractOptions options = extract_options(request.parameters, request.iso);
  with_sample(samples.type, [&](auto sample) {
    const auto lattice = lattice_of<decltype(sample)>(samples);
    // Of few samples, what is set aside takes less time in memory.
    mesh::Spool* spool = lattice.dims.samples() > kFewSamples ? request.spool : nullptr;
    mesh::SurfaceWindows windows(lattice, options, progress.context(), spool);
    const mesh::SurfaceSize surface = size_of(windows.count());
    check_memory(surface, lattice.dims.samples(), request);
    check_disk(surface, request);
    if (spool != nullptr) give_back_freed_memory();
    constexpr std::array kMeanwhile = {Stage::kSmooth};
    progress.enter(Stage::kEncode, kMeanwhile);
    FacetFiles files(request, sinks, surface, progress.quiet());
    const mesh::WalkEnd end =
        mesh::walk(windows, smoothing_of(samples, request.parameters), progress.context(), files);
    progress.share_out(std::array{Progress::Seconds{Stage::kExtract, end.seconds.extracting},
                                  Progress::Seconds{Stage::kSmooth, end.seconds.smoothing},
                                  Progress::Seconds{Stage::kEncode, end.seconds.using_it}});
    files.set_measures(end.effect, surface, summary);
  });
  return summary;
}

}  // namespace isomesh::jobs
