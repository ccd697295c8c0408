#include "server/jobs/making/walk_stage.h"

#include <array>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "proto/samples.h"
#include "server/codec/walked_file.h"
#include "server/jobs/making/memory.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/mesh_stages.h"
#include "server/jobs/making/thin_walls.h"
#include "server/mesh/extract/windows.h"
#include "server/mesh/measure/shapes.h"
#include "server/mesh/topology/window_topology.h"
#include "server/mesh/walk/walk.h"

namespace isomesh::jobs {
namespace {

using Files = std::vector<std::unique_ptr<codec::WalkedFile>>;

// Writes files, and measures the surface.
class FilesAndMeasures : public mesh::WindowUser {
 public:
  FilesAndMeasures(Files& files, bool is_smoothed, std::uint64_t triangles, mesh::Context quiet)
      : files_(files),
        is_smoothed_(is_smoothed),
        quiet_(std::move(quiet)),
        extracted_(triangles),
        final_(triangles) {}

  void see_extracted(const mesh::Mesh& mesh, std::size_t begin, std::size_t end) override {
    extracted_.add(mesh, begin, end);
  }

  std::size_t begin(const mesh::Window& window) override {
    if (is_smoothed_) final_.add(window.mesh, 0, window.mesh.triangles.size());
    std::size_t parts = 1;
    for (const auto& file : files_) {
      file->see(window);
      parts += file->parts(window);
    }
    return parts;
  }

  InOrder work(const mesh::Window& window, std::size_t part) override {
    if (part == 0) {
      const auto found = std::make_shared<mesh::WindowTopology>(window.mesh, window.below, quiet_);
      return [this, found] { topology_.add(*found); };
    }
    --part;
    for (const auto& file : files_) {
      const std::size_t parts = file->parts(window);
      if (part < parts) return file->work(window, part);
      part -= parts;
    }
    return [] {};
  }

  mesh::Topology topology(const mesh::SurfaceSize& surface) const {
    return topology_.result(surface.vertices, surface.triangles);
  }

  void set_measures(const mesh::SmoothingEffect& effect, const mesh::SurfaceSize& surface,
                    MeshSummary& summary) const {
    set_smoothing(extracted_.result(), effect, summary);
    if (is_smoothed_) set_final(final_.result(), summary.quality);
    set_size(surface, summary);
    set_topology(topology(surface), summary);
  }

 private:
  Files& files_;
  const bool is_smoothed_;
  const mesh::Context quiet_;
  mesh::ShapesSum extracted_;
  mesh::ShapesSum final_;
  mesh::TopologySum topology_;
};

}  // namespace

std::optional<MeshSummary> walk_stage(const SampleArray& samples, const MeshRequest& request,
                                      std::span<const codec::Sink> sinks, Progress& progress,
                                      mesh::Mesh& mesh) {
  constexpr double kCounting = 0.2;  // of extraction
  const MeshParameters& parameters = request.parameters;
  const codec::Provenance provenance = provenance_of(samples, request);
  MeshSummary summary;
  summary.iso = request.iso;
  const mesh::ExtractOptions options = extract_options(parameters, request.iso);
  return with_sample(samples.type, [&](auto sample) -> std::optional<MeshSummary> {
    const auto lattice = lattice_of<decltype(sample)>(samples);
    const std::uint64_t count = lattice.dims.samples();
    const bool is_searched = searches_cavities(samples, parameters, progress.quiet());
    const bool is_large = can_be_walked(parameters, request.measures) && sets_aside(count);
    mesh::Spool* const spool = is_large ? request.spool : nullptr;
    Files files;
    for (bool is_first = true; is_first || !files.empty(); is_first = false) {
      progress.enter(Stage::kExtract);
      const mesh::Context extracting = progress.context();
      mesh::SurfaceWindows windows(lattice, options, extracting.part(0, kCounting), spool);
      const mesh::SurfaceSize surface = size_of(windows.count());
      const std::uint64_t searching = is_searched ? cavity_search_memory(samples, surface) : 0;
      check_memory(surface, count, request, {.searching_bytes = searching});
      if (!is_walked(surface, parameters, request.measures)) {
        windows.write_whole(extracting.part(kCounting, 1), mesh);
        return std::nullopt;
      }
      check_disk(surface, request);
      if (spool != nullptr) give_back_freed_memory();
      constexpr std::array kMeanwhile = {Stage::kSmooth};
      progress.enter(Stage::kEncode, kMeanwhile);
      const std::vector<MeshFormat> formats = files_of(parameters);
      for (std::size_t i = 0; is_first && i < formats.size(); ++i) {
        files.push_back(codec::walked_file(
            {provenance, formats[i], surface, windows.reach(), sinks[i], spool, progress.quiet()}));
      }
      FilesAndMeasures user(files, parameters.passes > 0, surface.triangles, progress.quiet());
      const mesh::WalkEnd end =
          mesh::walk(windows, walk_options(smoothing_of(samples, parameters), parameters, surface),
                     progress.context(), user);
      progress.share_out(std::array{Progress::Seconds{Stage::kExtract, end.seconds.extracting},
                                    Progress::Seconds{Stage::kSmooth, end.seconds.smoothing},
                                    Progress::Seconds{Stage::kEncode, end.seconds.using_it}});
      user.set_measures(end.effect, surface, summary);
      const mesh::Topology topology = user.topology(surface);
      std::erase_if(files, [&](const auto& file) { return file->end(topology); });
    }
    return summary;
  });
}

}  // namespace isomesh::jobs
