#include "server/codec/formats.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <string>

#include "proto/error.h"
#include "server/codec/array_chunk.h"
#include "server/codec/decode/decoders.h"
#include "server/codec/levels.h"

namespace isomesh::codec {
namespace {

using mesh::SurfaceSize;

constexpr std::string_view kUnregistered = "application/octet-stream";

double as_double(std::uint64_t count) { return static_cast<double>(count); }

// Bytes per vertex in Draco, which are `usual` at the default number of bits. Another bit per
// coordinate adds about one bit per coordinate and vertex.
double draco_bytes_per_vertex(double usual, const MeshParameters& parameters) {
  constexpr double kSmallest = 1;
  const double more_bits = parameters.draco.position_bits - DracoParameters{}.position_bits;
  return std::max(kSmallest, usual + 3 * more_bits / 8);
}

// The triangles of all levels of detail, relative to the finest.
double levels_of(const MeshParameters& parameters) {
  return parameters.lods.empty()
             ? 1
             : std::accumulate(parameters.lods.begin(), parameters.lods.end(), 0.0);
}

bool always(const MeshParameters& /*parameters*/) { return true; }

bool if_ours(const MeshParameters& parameters) { return is_own_draco(parameters.draco); }

std::optional<mesh::Topology> encode_turned_drc(const FileContent& content,
                                                const mesh::Context& context, const Sink& sink) {
  return use_in_space(content.mesh, content.space, [&](const mesh::Mesh& mesh) {
    return encode_drc(mesh, content.provenance.parameters.draco, context, sink);
  });
}

// The bytes of a vertex in GLB with draco or meshopt; measured.
double compressed_glb_vertex(const MeshParameters& parameters) {
  constexpr double kNormalBytes = 1.5;
  constexpr double kDistanceBytes = 1.5;
  constexpr double kMeshoptBytes = 7;
  return (parameters.glb_codec == GlbCodec::kDraco ? draco_bytes_per_vertex(2.7, parameters)
                                                   : kMeshoptBytes) +
         (parameters.normals ? kNormalBytes : 0) + (parameters.distances ? kDistanceBytes : 0);
}

double glb_bytes(const SurfaceSize& surface, const MeshParameters& parameters) {
  constexpr double kVectorOfFloats = 12;
  constexpr double kVectorOfSteps = 8;
  constexpr double kVectorOfBytes = 4;
  double vertex = parameters.distances ? sizeof(float) : 0;
  double triangle = 0;
  if (parameters.glb_codec == GlbCodec::kNone) {
    vertex += parameters.normals ? 2 * kVectorOfFloats : kVectorOfFloats;
    triangle = sizeof(mesh::Triangle);
  } else if (parameters.glb_codec == GlbCodec::kQuantized) {
    constexpr double kOnSeams = 1.05;  // blocks have the vertices between them twice
    vertex += parameters.draco.position_bits <= kMostStepBits ? kVectorOfSteps : kVectorOfFloats;
    vertex = kOnSeams * (vertex + (parameters.normals ? kVectorOfBytes : 0));
    triangle = parameters.merge ? sizeof(mesh::Triangle) : 3 * sizeof(std::uint16_t);
  } else {
    vertex = compressed_glb_vertex(parameters);
  }
  return 2000 + levels_of(parameters) * (as_double(surface.vertices) * vertex +
                                         as_double(surface.triangles) * triangle);
}

// For encoders that hold one label's surface, which can be almost everything, with marks of its
// vertices. Half of it, because a job by labels counts the memory of encoders twice, for both sides
// of its walls, and a label's surface has one.
std::uint64_t label_memory(const SurfaceSize& surface, const MeshParameters& parameters) {
  constexpr std::uint64_t kMarksPerTriangle = 2;
  if (!parameters.labels) return 0;
  return (surface.vertices * sizeof(mesh::Vec3) +
          surface.triangles * (sizeof(mesh::Triangle) + kMarksPerTriangle)) /
         2;
}

std::uint64_t glb_memory(const SurfaceSize& surface, const MeshParameters& parameters) {
  // Measured: its blocks and their bytes.
  constexpr std::uint64_t kPerTriangle = 15;
  constexpr std::uint64_t kNormalsPerTriangle = 8;
  // Arrays of all vertices and triangles of a primitive.
  constexpr std::uint64_t kArraysPerTriangle = 40;
  constexpr std::uint64_t kMergedPerTriangle = 75;
  // A copy of the surface and its simplification.
  constexpr std::uint64_t kLevelsPerTriangle = 130;
  // The coarser levels that a file without a codec is written from.
  constexpr std::uint64_t kKeptPerTriangle = 30;
  std::uint64_t bytes = parameters.normals ? surface.vertices * sizeof(mesh::Vec3) : 0;
  if (parameters.distances) bytes += surface.vertices * 2 * sizeof(float);
  if (parameters.lods.size() > 1) bytes += surface.triangles * kLevelsPerTriangle;
  if (parameters.glb_codec == GlbCodec::kNone) {
    const double coarser = levels_of(parameters) - 1;
    return bytes + label_memory(surface, parameters) +
           static_cast<std::uint64_t>(coarser * as_double(surface.triangles)) * kKeptPerTriangle;
  }
  bytes += surface.triangles * kPerTriangle;
  if (parameters.normals) bytes += surface.triangles * kNormalsPerTriangle;
  if (parameters.glb_codec != GlbCodec::kDraco) bytes += surface.triangles * kArraysPerTriangle;
  if (parameters.merge) bytes += surface.triangles * kMergedPerTriangle;
  return bytes;
}

double usd_bytes(const SurfaceSize& surface, const MeshParameters& parameters) {
  return 1500 + (parameters.normals ? 65 : 30) * as_double(surface.vertices) +
         24 * as_double(surface.triangles);
}

std::uint64_t usd_memory(const SurfaceSize& surface, const MeshParameters& parameters) {
  return (parameters.normals ? surface.vertices * sizeof(mesh::Vec3) : 0) +
         label_memory(surface, parameters);
}

constexpr std::array kFormats = {
    Format{.format = MeshFormat::kDrc,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 6.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 return 100 + as_double(surface.vertices) * draco_bytes_per_vertex(2.6, parameters);
               },
           .memory_bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 // Measured: libdraco at its slowest speed, and our own encoder in the worst case,
                 // all vertices in two layers.
                 constexpr std::uint64_t kLibdracoPerTriangle = 100;
                 constexpr std::uint64_t kOwnPerTriangle = 75;
                 const std::uint64_t turned = parameters.space == Space::kLps
                                                  ? 0
                                                  : surface.triangles * sizeof(mesh::Triangle) +
                                                        surface.vertices * sizeof(mesh::Vec3);
                 return turned + surface.triangles * (is_own_draco(parameters.draco)
                                                          ? kOwnPerTriangle
                                                          : kLibdracoPerTriangle);
               },
           .shows_topology = if_ours,
           .encode = encode_turned_drc,
           .decode = decoding::decode_drc},
    Format{.format = MeshFormat::kGlb,
           .media_type = "model/gltf-binary",
           .milliseconds_per_triangle = 4.0e-5,
           .bytes = glb_bytes,
           .has_exact_bytes =
               [](const MeshParameters& parameters) {
                 return parameters.glb_codec == GlbCodec::kNone && parameters.lods.size() <= 1;
               },
           .memory_bytes = glb_memory,
           .shows_topology =
               [](const MeshParameters& parameters) {
                 return parameters.glb_codec == GlbCodec::kNone ||
                        (parameters.glb_codec == GlbCodec::kDraco && if_ours(parameters) &&
                         !parameters.distances);
               },
           .encode = encode_glb,
           .decode = decoding::decode_glb},
    Format{.format = MeshFormat::kStl,
           .media_type = "model/stl",
           .milliseconds_per_triangle = 3.0e-5,
           .bytes = [](const SurfaceSize& surface,
                       const MeshParameters&) { return 84 + 50 * as_double(surface.triangles); },
           .has_exact_bytes = always,
           .encode = encode_stl},
    Format{.format = MeshFormat::kPly,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 3.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 const double vertex_bytes = parameters.labels ? 19 : 12;
                 return 300 + vertex_bytes * as_double(surface.vertices) +
                        13 * as_double(surface.triangles);
               },
           .has_exact_bytes = always,
           .memory_bytes = label_memory,
           .encode = encode_ply},
    Format{.format = MeshFormat::kObj,
           .media_type = "model/obj",
           .milliseconds_per_triangle = 2.0e-4,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters&) {
                 return 100 + 30 * as_double(surface.vertices) + 24 * as_double(surface.triangles);
               },
           .memory_bytes = label_memory,
           .encode = encode_obj},
    Format{.format = MeshFormat::k3mf,
           .media_type = "model/3mf",
           .milliseconds_per_triangle = 6.5e-4,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters&) {
                 return 2000 + 18 * as_double(surface.vertices) + 7 * as_double(surface.triangles);
               },
           .memory_bytes = label_memory,
           .encode = encode_3mf},
    Format{.format = MeshFormat::kUsda,
           .media_type = "model/vnd.usda",
           .milliseconds_per_triangle = 3.0e-4,
           .bytes = usd_bytes,
           .memory_bytes = usd_memory,
           .encode = encode_usda},
    Format{.format = MeshFormat::kUsdz,
           .media_type = "model/vnd.usdz+zip",
           .milliseconds_per_triangle = 6.0e-4,  // formatted twice
           .bytes = usd_bytes,
           .memory_bytes = usd_memory,
           .encode = encode_usdz},
    Format{.format = MeshFormat::kOff,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 2.0e-4,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters&) {
                 return 100 + 28 * as_double(surface.vertices) + 24 * as_double(surface.triangles);
               },
           .encode = encode_off},
    Format{.format = MeshFormat::kVtk,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 3.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 return 200 + 12 * as_double(surface.vertices) +
                        (parameters.labels ? 20 : 16) * as_double(surface.triangles);
               },
           .has_exact_bytes = always,
           .encode = encode_vtk},
    Format{.format = MeshFormat::kVtp,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 3.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 return 4000 + 12 * as_double(surface.vertices) +
                        (parameters.labels ? 20 : 16) * as_double(surface.triangles);
               },
           .has_exact_bytes = always,
           .encode = encode_vtp},
    Format{.format = MeshFormat::kGii,
           .media_type = kUnregistered,
           .milliseconds_per_triangle = 6.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters&) {
                 return 2500 + 16 * as_double(surface.vertices) + 16 * as_double(surface.triangles);
               },
           .encode = encode_gii},
    Format{.format = MeshFormat::kZip,
           .media_type = "application/zip",
           .milliseconds_per_triangle = 3.0e-5,
           .bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 double bytes = 22;
                 for (const MeshFormat format : zipped_formats(parameters)) {
                   bytes += describe(format).bytes(surface, parameters);
                 }
                 return bytes;
               },
           .memory_bytes =
               [](const SurfaceSize& surface, const MeshParameters& parameters) {
                 // Encoder memory and output of the labels in progress.
                 std::uint64_t bytes = 0;
                 for (const MeshFormat format : zipped_formats(parameters)) {
                   const Format& row = describe(format);
                   bytes += row.memory_bytes(surface, parameters) +
                            static_cast<std::uint64_t>(row.bytes(surface, parameters));
                 }
                 return bytes;
               },
           .encode = nullptr},
};

}  // namespace

const Format& describe(MeshFormat format) {
  const auto found = std::ranges::find(kFormats, format, &Format::format);
  if (found == kFormats.end()) throw Error(ErrorCode::kInternal, "a format has no row");
  return *found;
}

bool rounds(MeshFormat format, const MeshParameters& parameters) {
  if (format == MeshFormat::kGlb && parameters.glb_codec == GlbCodec::kNone) return false;
  if (format != MeshFormat::kZip) return describe(format).decode != nullptr;
  return std::ranges::any_of(zipped_formats(parameters),
                             [&](MeshFormat each) { return rounds(each, parameters); });
}

std::optional<mesh::Topology> encode(const mesh::Mesh& mesh, MeshFormat format,
                                     const Provenance& provenance, const mesh::Context& context,
                                     const Sink& sink, const mesh::TriangleGrid* extracted) {
  const Format& row = describe(format);
  if (row.encode == nullptr) {
    throw Error(ErrorCode::kInternal, "a ZIP holds labels, not one surface");
  }
  return row.encode({.mesh = mesh,
                     .provenance = provenance,
                     .format = format,
                     .space = space_of(format, provenance.parameters),
                     .unit = length_unit(provenance.notes),
                     .extracted = extracted},
                    context, sink);
}

void encode_labels(const LabelledSurface& surface, MeshFormat format, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink) {
  if (!holds_all_labels(format)) {
    throw Error(ErrorCode::kInternal, "a file of that format does not hold all labels");
  }
  describe(format).encode({.mesh = surface.walls.mesh,
                           .provenance = provenance,
                           .format = format,
                           .space = space_of(format, provenance.parameters),
                           .unit = length_unit(provenance.notes),
                           .labels = &surface},
                          context, sink);
}

DecodedSurface decode(std::span<const std::byte> file, MeshFormat format, Space space,
                      const mesh::Context& context) {
  context.throw_if_stopped();
  const Format& row = describe(format);
  if (row.decode == nullptr) decoding::refuse(format, "nothing decodes this format");
  DecodedSurface surface = row.decode(file, context);
  decoding::check(surface, format, context);
  if (space == Space::kRas) {
    for (mesh::Vec3& position : surface.positions) position = in_space(position, space);
  }
  return surface;
}

}  // namespace isomesh::codec
