#include "server/jobs/making/make_labels.h"

#include <algorithm>
#include <optional>
#include <string>
#include <type_traits>

#include "proto/samples.h"
#include "server/codec/formats.h"
#include "server/codec/label_zip.h"
#include "server/jobs/making/certify_stage.h"
#include "server/jobs/making/error_budget.h"
#include "server/jobs/making/mesh_cost.h"
#include "server/jobs/making/mesh_stages.h"
#include "server/jobs/making/thin_walls.h"
#include "server/mesh/parallel.h"
#include "server/mesh/stairs/stairs.h"

namespace isomesh::jobs {
namespace {

// Calls use(a sample of the type) and returns its result. The samples are integers: those of floats
// were rounded (crop.h).
template <class Use>
auto with_label(SampleType type, const Use& use) {
  using Result = decltype(use(std::uint8_t{}));
  return with_sample(type, [&](auto sample) -> Result {
    if constexpr (std::is_integral_v<decltype(sample)>) {
      return use(sample);
    } else {
      throw Error(ErrorCode::kInternal, "Labels were not rounded.");
    }
  });
}

mesh::SeparateOptions separate_options(const std::vector<mesh::LabelVoxels>& labels,
                                       const MeshParameters& parameters) {
  mesh::SeparateOptions options = {.labels = {},
                                   .scheme = scheme_of(parameters.scheme),
                                   .close = parameters.close,
                                   .regularize = parameters.regularize};
  for (const mesh::LabelVoxels& label : labels) {
    options.labels.push_back(label.label);
    const auto values = parameters.label_values.find(label.label);
    if (values != parameters.label_values.end()) options.values.insert(*values);
  }
  return options;
}

void separate(const SampleArray& samples, std::span<const mesh::LabelVoxels> labels,
              const mesh::SeparateOptions& options, const MeshRequest& request,
              const Progress& progress, mesh::SeparatingSurface& walls) {
  with_label(samples.type, [&](auto sample) {
    const auto lattice = lattice_of<decltype(sample)>(samples);
    const mesh::Context context = progress.context();
    const mesh::Context quiet = progress.quiet();
    const mesh::SurfaceCount count = count_walls(lattice, options, context.part(0.2, 0.4));
    MemoryUse use = {.searching_bytes = cavity_search_memory(samples, labels, size_of(count))};
    // Each triangle is in the surfaces of two labels at most, unless labels share samples.
    if (mesh::LabelParts(options.labels, options.values).overlap()) {
      for (const std::uint64_t each : count_label_triangles(lattice, options, count, quiet)) {
        use.of_labels += each;
      }
    }
    check_memory(size_of(count), lattice.dims.samples(), request, use);
    extract_walls(lattice, options, count, context.part(0.4, 1), walls);
  });
}

void smooth_walls(const SampleArray& samples, const mesh::SeparateOptions& options,
                  const MeshRequest& request, Progress& progress, mesh::SeparatingSurface& walls,
                  MeshSummary& summary) {
  if (!removes_stairs(request.parameters)) {
    return smooth_stage(samples, request, progress, walls.mesh, summary);
  }
  const auto remove = [&](const mesh::Context& context) {
    return with_label(samples.type, [&](auto sample) {
      return remove_stairs(lattice_of<decltype(sample)>(samples), options,
                           most_displacement(request.parameters), context, walls);
    });
  };
  smooth_stage(remove, progress, walls.mesh, summary);
}

std::optional<std::string> text_of(const LabelTexts& texts, std::int64_t label) {
  const auto found = texts.find(label);
  return found == texts.end() ? std::nullopt : std::optional(found->second);
}

LabelSummary summary_of(const mesh::LabelVoxels& voxels, const mesh::LabelMeasure& measure,
                        const MeshParameters& parameters) {
  return {.label = voxels.label,
          .name = text_of(parameters.label_names, voxels.label),
          .color = text_of(parameters.label_colors, voxels.label),
          .voxels = voxels.voxels,
          .voxels_mm3 = voxels.volume_mm3,
          .triangles = measure.triangles,
          .vertices = measure.vertices,
          .closed = measure.is_closed(),
          .manifold = measure.topology.manifold,
          .oriented = measure.topology.oriented,
          .components = measure.topology.components,
          .area_mm2 = measure.extent.area_mm2,
          .volume_mm3 = measure.extent.volume_mm3};
}

// Sets what holds for the own surfaces of all labels.
void set_quality(const std::vector<mesh::LabelMeasure>& measures, MeshSummary& summary) {
  MeshQuality& quality = summary.quality;
  quality.manifold = true;
  quality.oriented = true;
  for (const mesh::LabelMeasure& measure : measures) {
    summary.boundary_edges += measure.topology.boundary_edges;
    summary.components += measure.topology.components;
    summary.euler += measure.topology.euler;
    quality.manifold = quality.manifold && measure.topology.manifold;
    quality.oriented = quality.oriented && measure.topology.oriented;
  }
  conclude_quality(summary);
}

void measure_all_walls(const SampleArray& samples, const mesh::SeparateOptions& options,
                       const Progress& progress, const mesh::SeparatingSurface& walls,
                       MadeLabels& made) {
  const mesh::VoxelFaces faces = with_label(samples.type, [&](auto sample) {
    return count_faces(lattice_of<decltype(sample)>(samples), options, progress.quiet());
  });
  made.walls = measure_walls(walls, faces, progress.quiet());
  const auto shared = std::ranges::count_if(made.walls, &mesh::WallArea::faces);
  made.summary.walls_count = static_cast<std::uint64_t>(shared);
  made.summary.edge_contacts_count = made.walls.size() - static_cast<std::uint64_t>(shared);
}

void encode_all(const codec::LabelledSurface& surface, const codec::Provenance& provenance,
                std::span<const codec::Sink> sinks, const Progress& progress,
                MeshSummary& summary) {
  const MeshParameters& parameters = provenance.parameters;
  const std::vector<MeshFormat> files = files_of(parameters);
  std::vector<codec::LabelFiles> zipped;
  SharedProgress shared(progress, files.size());
  const auto encode = [&](std::size_t i) {
    const mesh::Context context = shared.context(i);
    if (files[i] != MeshFormat::kZip) {
      return codec::encode_labels(surface, files[i], provenance, context, sinks[i]);
    }
    zipped = encode_labels_zip(surface, zipped_formats(parameters), provenance, context, sinks[i]);
  };
  mesh::parallel_for(progress.quiet(), files.size() + 1, [&](std::size_t task) {
    if (task < files.size()) return encode(task);
    measure_final_shapes(parameters, progress, surface.walls.mesh, summary.quality);
  });
  for (std::size_t n = 0; n < zipped.size(); ++n) summary.labels[n].files = std::move(zipped[n]);
}

}  // namespace

std::vector<mesh::LabelVoxels> count_values(const SampleArray& samples,
                                            const mesh::Context& context) {
  return with_label(samples.type, [&](auto sample) {
    return mesh::count_labels(lattice_of<decltype(sample)>(samples), context);
  });
}

CountedSurface count_labels(const SampleArray& samples, const MeshParameters& parameters,
                            const mesh::Context& context) {
  const auto labels = mesh::chosen_labels(count_values(samples, context), parameters);
  const auto options = separate_options(labels, parameters);
  return with_label(samples.type, [&](auto sample) {
    const auto lattice = lattice_of<decltype(sample)>(samples);
    const mesh::SurfaceCount count = count_walls(lattice, options, context);
    CountedSurface counted = {.size = size_of(count)};
    counted.searching_bytes = cavity_search_memory(samples, labels, counted.size);
    const auto triangles = count_label_triangles(lattice, options, count, context);
    for (std::size_t n = 0; n < options.labels.size(); ++n) {
      counted.labels.push_back({options.labels[n], triangles[n + 1]});
    }
    return counted;
  });
}

MadeLabels make_labels(const SampleArray& samples, const MeshRequest& request,
                       std::span<const codec::Sink> sinks, Progress& progress,
                       mesh::SeparatingSurface& walls) {
  const MeshParameters& parameters = request.parameters;
  MadeLabels made;
  MeshSummary& summary = made.summary;
  progress.enter(Stage::kExtract);
  const auto labels =
      mesh::chosen_labels(count_values(samples, progress.context().part(0, 0.2)), parameters);
  const mesh::SeparateOptions options = separate_options(labels, parameters);
  separate(samples, labels, options, request, progress, walls);
  summary.notes = notes_on_thin_walls(samples, labels, parameters, progress.quiet());
  if (!is_simplified(parameters)) check_disk(size_of(walls.mesh), request);
  const double extracted_mm3 = enclosed_by_all(walls, progress.quiet());
  KeptSurface extracted = kept_extracted(request, walls.mesh);

  smooth_walls(samples, options, request, progress, walls, summary);
  untangle_stage(parameters, extracted, progress, walls.mesh, summary);
  const KeptSurface smoothed = kept_smoothed(request, walls.mesh);
  const MeshParameters as_written = with_bits_for(parameters, walls.mesh);
  const MeshRequest written = request.with(as_written);
  simplify_stage(samples, written, extracted, progress, walls.mesh, &walls, summary);
  set_size(size_of(walls.mesh), summary);
  if (is_simplified(parameters)) check_disk(size_of(walls.mesh), request);
  summary.volume_mm3 = {extracted_mm3, enclosed_by_all(walls, progress.quiet())};

  progress.enter(Stage::kEncode);
  const auto surfaces = label_surfaces(walls, progress.quiet());
  const auto measures = measure_labels(walls, surfaces, progress.quiet());
  set_quality(measures, summary);
  measure_all_walls(samples, options, progress, walls, made);
  for (std::size_t n = 0; n < labels.size(); ++n) {
    summary.labels.push_back(summary_of(labels[n], measures[n], parameters));
  }
  const KeptFiles files(written, sinks);
  {
    const auto grid = grid_for_distances(parameters, extracted, progress);
    encode_all({walls, surfaces, summary.labels, grid ? &*grid : nullptr},
               provenance_of(samples, written), files.sinks(), progress, summary);
  }
  const bool is_smoothed = error_reference(parameters) == MeshCertificate::Reference::kSmoothed;
  certify_stage(written, is_smoothed ? smoothed : extracted, files, progress, walls.mesh, summary);
  const auto label = [&](std::size_t n) -> const mesh::Mesh& { return surfaces[n].mesh; };
  thickness_stage(request, labels.size(), label, progress, summary);
  return made;
}

}  // namespace isomesh::jobs
