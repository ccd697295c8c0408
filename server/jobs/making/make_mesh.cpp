#include "server/jobs/making/make_mesh.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "proto/samples.h"
#include "proto/stages.h"
#include "server/codec/formats.h"
#include "server/jobs/making/certify_stage.h"
#include "server/jobs/making/changed_volume.h"
#include "server/jobs/making/error_budget.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/mesh_stages.h"
#include "server/jobs/making/thin_walls.h"
#include "server/jobs/making/walk_stage.h"
#include "server/mesh/measure/cavities.h"
#include "server/mesh/parallel.h"
#include "server/mesh/topology/components.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::jobs {
namespace {

using Clock = std::chrono::steady_clock;

bool shows_topology(const MeshParameters& parameters) {
  return std::ranges::any_of(parameters.formats, [&](MeshFormat format) {
    return codec::describe(format).shows_topology(parameters);
  });
}

// Encodes every format and measures the mesh, all in parallel, because few of these tasks keep all
// threads busy. Measures the topology only if no encoder reports it.
void encode_and_measure(const codec::Provenance& provenance, std::span<const codec::Sink> sinks,
                        const KeptSurface& extracted, const Progress& progress,
                        const mesh::Mesh& mesh, MeshSummary& summary) {
  const MeshParameters& parameters = provenance.parameters;
  const auto grid = grid_for_distances(parameters, extracted, progress);
  const std::vector<MeshFormat>& formats = parameters.formats;
  std::vector<std::optional<mesh::Topology>> shown(formats.size() + 1);
  SharedProgress shared(progress, formats.size());
  const auto encode = [&](std::size_t i) {
    shown[i] = codec::encode(mesh, formats[i], provenance, shared.context(i), sinks[i],
                             grid ? &*grid : nullptr);
  };
  const auto measure = [&] {
    measure_final_shapes(parameters, progress, mesh, summary.quality);
    if (!shows_topology(parameters)) shown.back() = measure_topology(mesh, progress.quiet());
  };
  mesh::parallel_for(progress.quiet(), formats.size() + 1, [&](std::size_t task) {
    if (task < formats.size()) return encode(task);
    measure();
  });
  const auto found = std::ranges::find_if(shown, [](const auto& one) { return one.has_value(); });
  set_topology(found != shown.end() ? **found : measure_topology(mesh, progress.quiet()), summary);
}

// Removes the components and cavities that the parameters drop.
void leave_out_parts(const MeshParameters& parameters, const Progress& progress, mesh::Mesh& mesh,
                     MeshSummary::Dropped& dropped) {
  const auto add = [&](const mesh::Dropped& more) {
    dropped.components += more.components;
    dropped.triangles += more.triangles;
  };
  if (parameters.fill_cavities) add(fill_cavities(progress.quiet(), mesh));
  if (!parameters.components.keeps_all()) {
    add(keep_components(parameters.components, progress.quiet(), mesh));
  }
}

// Adds a note on the volume, if there is one and the surface encloses a volume.
void tell(const std::optional<Note>& on_volume, MeshSummary& summary) {
  if (on_volume && summary.quality.encloses_volume) summary.notes.push_back(*on_volume);
}

}  // namespace

Progress::Progress(std::stop_token stop, const Report& report, const Timing& expected)
    : stop_(std::move(stop)), report_(report), expected_(expected) {
  for (const StageRow& row : kStages) {
    if (row.elapsed != nullptr) expected_ms_ += expected.*row.elapsed;
  }
}

void Progress::enter(Stage stage, std::span<const Stage> meanwhile) {
  end_stage();
  stage_ = stage;
  done_before_ += share_;
  double expected_ms = expected_.*row_of(stage).elapsed;
  for (const Stage other : meanwhile) expected_ms += expected_.*row_of(other).elapsed;
  share_ = expected_ms_ > 0 ? expected_ms / expected_ms_ : 0;
  began_ = Clock::now();
  report_(stage_, done_before_, timing_);
}

void Progress::end_stage() {
  if (stage_ == Stage::kQueue) return;  // nothing has begun
  timing_.*row_of(stage_).elapsed += elapsed_ms();
}

void Progress::share_out(std::span<const Seconds> spent) {
  const double elapsed = elapsed_ms();
  began_ = Clock::now();
  double sum = 0;
  for (const auto& [stage, seconds] : spent) sum += seconds;
  for (const auto& [stage, seconds] : spent) {
    timing_.*row_of(stage).elapsed += sum > 0 ? elapsed * seconds / sum : 0;
  }
}

double Progress::elapsed_ms() const {
  return std::chrono::duration<double, std::milli>(Clock::now() - began_).count();
}

CountedSurface count_surface(const SampleArray& samples, const MeshRequest& request,
                             const mesh::Context& context) {
  const mesh::ExtractOptions options = extract_options(request.parameters, request.iso);
  CountedSurface counted;
  counted.size = with_sample(samples.type, [&](auto sample) {
    return size_of(mesh::count_surface(lattice_of<decltype(sample)>(samples), options, context));
  });
  if (searches_cavities(samples, request.parameters, context)) {
    counted.searching_bytes = cavity_search_memory(samples, counted.size);
  }
  return counted;
}

void Workspace::trim(std::size_t budget_bytes) {
  std::size_t held = walls.sides.capacity_bytes() + walls.owners.capacity_bytes();
  for (const mesh::Mesh& each : {std::cref(mesh), std::cref(walls.mesh)}) {
    held += each.positions.capacity_bytes() + each.triangles.capacity_bytes();
  }
  if (held > budget_bytes) *this = {};
}

MeshSummary make_mesh(const SampleArray& samples, const MeshRequest& request,
                      std::span<const codec::Sink> sinks, Progress& progress, mesh::Mesh& mesh) {
  const MeshParameters& parameters = request.parameters;
  auto walked = walk_stage(samples, request, sinks, progress, mesh);
  std::vector<Note> notes = notes_on_thin_walls(samples, request, progress.quiet());
  if (walked) {
    walked->notes = std::move(notes);
    tell(note_on_changed_volume(parameters, *walked), *walked);
    return *std::move(walked);
  }
  MeshSummary summary;
  summary.notes = std::move(notes);
  summary.iso = request.iso;
  leave_out_parts(parameters, progress, mesh, summary.dropped);
  if (!is_simplified(parameters)) check_disk(size_of(mesh), request);
  KeptSurface extracted = kept_extracted(request, mesh);

  smooth_stage(samples, request, progress, mesh, summary);
  untangle_stage(parameters, extracted, progress, mesh, summary);
  const std::optional<Note> changed_volume = note_on_changed_volume(parameters, summary);
  const MeshParameters as_written = with_bits_for(parameters, mesh);
  const MeshRequest written = request.with(as_written);
  simplify_stage(samples, written, extracted, progress, mesh, nullptr, summary);
  set_size(size_of(mesh), summary);
  if (is_simplified(parameters)) check_disk(size_of(mesh), request);

  progress.enter(Stage::kEncode);
  const KeptFiles files(written, sinks);
  encode_and_measure(provenance_of(samples, written), files.sinks(), extracted, progress, mesh,
                     summary);
  tell(changed_volume, summary);
  certify_stage(written, extracted, files, progress, mesh, summary);
  const auto itself = [&](std::size_t) -> const mesh::Mesh& { return mesh; };
  thickness_stage(request, 1, itself, progress, summary);
  return summary;
}

}  // namespace isomesh::jobs
