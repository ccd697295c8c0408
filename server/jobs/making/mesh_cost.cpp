#include "server/jobs/making/mesh_cost.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "server/codec/formats.h"
#include "server/codec/walked_file.h"
#include "server/jobs/making/error_budget.h"
#include "server/mesh/collapse/bound.h"
#include "server/mesh/labels/label_surface.h"
#include "server/mesh/labels/separate.h"
#include "server/mesh/measure/cavities.h"
#include "server/mesh/parallel.h"
#include "server/mesh/smooth/untangle.h"
#include "server/mesh/stairs/stairs.h"
#include "server/mesh/topology/window_topology.h"
#include "server/mesh/walk/walk.h"

namespace isomesh::jobs {
namespace {

std::uint64_t mesh_bytes(const mesh::SurfaceSize& surface) {
  return surface.vertices * sizeof(mesh::Vec3) + surface.triangles * sizeof(mesh::Triangle);
}

// With the room that arrays grow into.
constexpr std::uint64_t kJoinedPerVertex = 16;

// The planes of the volume's own samples. A closed surface has two layers more.
std::uint64_t planes_of(const mesh::SurfaceSize& surface, const MeshParameters& parameters) {
  const std::uint64_t around = parameters.close ? 2 : 0;
  return surface.layers > around ? surface.layers - around : 1;
}

mesh::WritingMemory writing_memory(std::uint64_t samples, const mesh::SurfaceSize& surface,
                                   const MeshParameters& parameters) {
  return mesh::writing_memory(
      {.scheme = scheme_of(parameters.scheme), .regularize = is_regularized(parameters)},
      samples / planes_of(surface, parameters));
}

// The memory that all threads write a surface in.
std::uint64_t writing_bytes(std::uint64_t samples, const mesh::SurfaceSize& surface,
                            const MeshParameters& parameters) {
  return static_cast<std::uint64_t>(mesh::thread_count()) *
         writing_memory(samples, surface, parameters).thread_bytes;
}

// The memory of a job that never has the surface as a whole: the walk, its files, the joined
// crossings if they are not set aside, and for each thread the topology of a window.
std::uint64_t walked_bytes(const mesh::SurfaceSize& surface, std::uint64_t samples,
                           const MeshParameters& parameters, bool has_spool) {
  // Measured: what the C library keeps of freed blocks takes up to a third of those in use, with
  // the surfaces whose bounds here are the closest; a fifth of the bounds covers it.
  constexpr std::uint64_t kHoles = 5;
  const bool is_set_aside = has_spool && sets_aside(samples);
  std::uint64_t files = 0;
  for (const MeshFormat format : files_of(parameters)) {
    files += codec::walked_memory(format, parameters, surface, is_set_aside);
  }
  mesh::WritingMemory writing = writing_memory(samples, surface, parameters);
  if (!is_set_aside) writing.vertex_bytes = 0;
  const std::uint64_t joined = parameters.regularize && !is_set_aside ? surface.vertices : 0;
  const mesh::WalkOptions options = walk_options(smooth_options(parameters), parameters, surface);
  const std::uint64_t topology =
      static_cast<std::uint64_t>(mesh::thread_count()) *
      mesh::WindowTopology::bytes(surface.most_vertices(mesh::kLayersPerPart));
  const std::uint64_t needed = mesh::walking_memory(options, surface, writing) + files +
                               joined * kJoinedPerVertex + topology;
  return needed + needed / kHoles;
}

// True if the windows of a walk, which overlap, and the layers that its steps keep take much more
// than the whole surface: it has few layers.
bool takes_more_walked(const mesh::SurfaceSize& surface, const MeshParameters& parameters) {
  const mesh::WalkOptions options = walk_options(smooth_options(parameters), parameters, surface);
  const std::uint64_t whole = mesh_bytes(surface) + smoothing_memory(options.smooth, surface);
  return mesh::walking_memory(options, surface, {}) > 2 * whole;
}

// The factor by which overlaps multiply the surfaces of labels, at least 1.
std::uint64_t overlaps_of(const mesh::SurfaceSize& surface, std::uint64_t of_labels) {
  const std::uint64_t usual = std::max<std::uint64_t>(1, 2 * surface.triangles);
  return std::max<std::uint64_t>(1, (of_labels + usual - 1) / usual);
}

// The memory of labels beside their walls: the sides of the triangles, the owners of the vertices,
// and all labels' own surfaces.
std::uint64_t label_bytes(const mesh::SurfaceSize& surface, std::uint64_t overlaps) {
  return surface.triangles * sizeof(mesh::WallSides) +
         surface.vertices * sizeof(mesh::VertexOwner) +
         overlaps * mesh::LabelSurface::bytes(surface.vertices, surface.triangles);
}

// The memory of untangling, simplifying and certifying, one after the other, beside the rest: the
// extracted surface, grids of triangles, and files that round coordinates, both as bytes and
// decoded.
std::uint64_t error_bytes(const mesh::SurfaceSize& surface, std::uint64_t samples,
                          const MeshParameters& parameters, const Measures& measures) {
  // From simplify.h, bound.h and triangle_grid.h, and a little more.
  constexpr std::uint64_t kSimplifyBytesPerTriangle = 280;
  constexpr std::uint64_t kProveBytesPerTriangle = 260;
  constexpr std::uint64_t kGridsPerTriangle = 130;
  std::uint64_t simplifying = 0;
  if (parameters.max_error_mm || parameters.triangles) {
    simplifying = surface.triangles * kSimplifyBytesPerTriangle;
  }
  if (parameters.max_error_mm && !parameters.labels) {
    const std::uint64_t planes = planes_of(surface, parameters);
    const std::uint64_t proving =
        surface.triangles * kProveBytesPerTriangle +
        mesh::proving_memory({.scheme = scheme_of(parameters.scheme), .close = parameters.close},
                             planes, samples / planes) +
        writing_bytes(samples, surface, parameters);
    // A surface that the field proves nothing about is simplified as without it.
    simplifying = std::max(simplifying, proving);
  }
  const bool keeps_extracted = parameters.max_error_mm || parameters.distances;
  // While files are encoded, and while thickness is measured.
  const bool has_grid = parameters.distances || measures.min_thickness_mm;
  const std::uint64_t grid = has_grid ? surface.triangles * kGridsPerTriangle : 0;
  const std::uint64_t untangling = parameters.untangle ? mesh::untangling_memory(surface) : 0;
  if (!measures.certify) {
    const std::uint64_t positions = parameters.untangle ? surface.vertices * sizeof(mesh::Vec3) : 0;
    return std::max({untangling, simplifying, grid}) +
           (keeps_extracted ? mesh_bytes(surface) : positions);
  }
  double files = 0;
  for (const MeshFormat format : files_of(parameters)) {
    if (!codec::rounds(format, parameters)) continue;
    files += 2 * codec::describe(format).bytes(surface, parameters);  // a growing vector
  }
  const std::uint64_t certifying = static_cast<std::uint64_t>(files) +
                                   (files > 0 ? 3 * mesh_bytes(surface) : 0) +
                                   surface.triangles * kGridsPerTriangle;
  // The error counts from the smoothed surface, and other distances from the extracted one.
  const bool keeps_both =
      parameters.distances && error_reference(parameters) == MeshCertificate::Reference::kSmoothed;
  return (keeps_both ? 2 : 1) * mesh_bytes(surface) +
         std::max({untangling, simplifying, certifying, grid});
}

// The least size of the files.
std::uint64_t least_file_bytes(const mesh::SurfaceSize& surface, const MeshParameters& parameters) {
  double bytes = 0;
  for (const MeshFormat format : files_of(parameters)) {
    const codec::Format& row = codec::describe(format);
    const double guess = row.bytes(surface, parameters);
    bytes += row.has_exact_bytes(parameters) ? guess : guess / 2;
  }
  return static_cast<std::uint64_t>(bytes);
}

}  // namespace

bool is_regularized(const MeshParameters& parameters) {
  return parameters.regularize && (parameters.labels || !parameters.max_error_mm);
}

bool can_be_walked(const MeshParameters& parameters, const Measures& measures) {
  const bool is_whole = parameters.labels || measures.certify || measures.min_thickness_mm ||
                        parameters.max_error_mm || parameters.triangles || parameters.untangle ||
                        parameters.fill_cavities || !parameters.components.keeps_all();
  // Without files, the caller wants the mesh itself.
  return !is_whole && !parameters.formats.empty() && mesh::can_walk(smooth_options(parameters)) &&
         std::ranges::all_of(files_of(parameters), [&](MeshFormat format) {
           return codec::is_walked(format, parameters);
         });
}

bool is_walked(const mesh::SurfaceSize& surface, const MeshParameters& parameters,
               const Measures& measures) {
  // Measured with two threads: a walk through the head's 1.8 million triangles, which have 32 MB,
  // takes 1.1 (STL) to 1.4 times (GLB) as long as the whole.
  constexpr std::uint64_t kFewTriangles = std::uint64_t{1} << 21;
  return can_be_walked(parameters, measures) && surface.triangles >= kFewTriangles &&
         !takes_more_walked(surface, parameters);
}

bool removes_stairs(const MeshParameters& parameters) {
  return mesh::method_of(parameters.smoothing).removes_stairs() && parameters.passes > 0;
}

mesh::SmoothOptions smooth_options(const MeshParameters& parameters) {
  const mesh::SmoothingMethod& method = mesh::method_of(parameters.smoothing);
  const mesh::Relaxation relaxation = {parameters.lambda.value_or(default_lambda(parameters)),
                                       parameters.pass_band};
  return {.steps = method.steps(parameters.passes, relaxation),
          .at_curves = method.at_curves,
          .max_displacement_mm = most_displacement(parameters)};
}

mesh::WalkOptions walk_options(mesh::SmoothOptions smooth, const MeshParameters& parameters,
                               const mesh::SurfaceSize& surface) {
  mesh::WalkOptions options = {.smooth = std::move(smooth)};
  for (const MeshFormat format : files_of(parameters)) {
    options.depth = std::max(options.depth, codec::walked_depth(format, parameters, surface));
    options.normals |= format == MeshFormat::kGlb && parameters.normals;
  }
  return options;
}

bool sets_aside(std::uint64_t samples) {
  constexpr std::uint64_t kFewSamples = std::uint64_t{1} << 22;
  return samples > kFewSamples;
}

std::uint64_t estimate_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                              const MeshParameters& parameters, const Measures& measures,
                              const MemoryUse& use) {
  if (is_walked(surface, parameters, measures)) {
    return std::max(walked_bytes(surface, samples, parameters, use.has_spool), use.searching_bytes);
  }
  std::uint64_t encoding = surface.vertices * 2 * sizeof(std::uint32_t);  // measured meanwhile
  for (const MeshFormat format : files_of(parameters)) {
    encoding += codec::describe(format).memory_bytes(surface, parameters);
  }
  const std::uint64_t smoothing = removes_stairs(parameters)
                                      ? mesh::stairs_memory(surface)
                                      : smoothing_memory(smooth_options(parameters), surface);
  const std::uint64_t overlaps = overlaps_of(surface, use.of_labels);
  const std::uint64_t made = smoothing + (parameters.labels ? 2 * overlaps * encoding : encoding) +
                             error_bytes(surface, samples, parameters, measures);
  if (parameters.labels) {
    const std::uint64_t writing =
        static_cast<std::uint64_t>(mesh::thread_count()) *
        mesh::wall_writing_memory(samples / planes_of(surface, parameters));
    return mesh_bytes(surface) + label_bytes(surface, overlaps) +
           std::max({writing, made, use.searching_bytes});
  }
  // The C library keeps what the joined crossings took, in small blocks.
  const std::uint64_t joined = is_regularized(parameters) ? surface.vertices * kJoinedPerVertex : 0;
  const std::uint64_t writing = writing_bytes(samples, surface, parameters);
  const std::uint64_t filling =
      parameters.fill_cavities ? mesh::filling_memory(surface.vertices, surface.triangles) : 0;
  return mesh_bytes(surface) + joined + std::max({writing, made, filling, use.searching_bytes});
}

void check_memory(const mesh::SurfaceSize& surface, std::uint64_t samples,
                  const MeshRequest& request, MemoryUse use) {
  use.has_spool = request.spool != nullptr;
  const std::uint64_t needed =
      estimate_memory(surface, samples, request.parameters, request.measures, use);
  const std::uint64_t allowed_bytes = request.memory_bytes;
  if (needed <= allowed_bytes) return;
  constexpr std::uint64_t kMebibyte = 1 << 20;
  throw Error(ErrorCode::kTooLarge,
              "the surface has " + std::to_string(surface.triangles) + " triangles and " +
                  std::to_string(surface.vertices) + " vertices; the job would need about " +
                  std::to_string(needed / kMebibyte) + " MiB of memory, but " +
                  std::to_string(allowed_bytes / kMebibyte) + " MiB are allowed");
}

void check_disk(const mesh::SurfaceSize& surface, const MeshRequest& request) {
  const std::uint64_t needed = least_file_bytes(surface, request.parameters);
  const std::uint64_t allowed_bytes = request.disk_bytes;
  if (needed <= allowed_bytes) return;
  constexpr std::uint64_t kKibibyte = 1 << 10;
  throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(surface.triangles) +
                                        " triangles; its files would need at least " +
                                        std::to_string(needed / kKibibyte) +
                                        " KiB, but the disk can hold at most " +
                                        std::to_string(allowed_bytes / kKibibyte) + " KiB of them");
}

}  // namespace isomesh::jobs
