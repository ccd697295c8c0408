// The formats of files of meshes: a row for each, with its encoder and what it costs. What clients
// know of a format, too, such as its name and its space, is in the row of proto/types.cpp.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "proto/types.h"
#include "server/codec/decode/decode.h"
#include "server/codec/encode.h"
#include "server/mesh/context.h"
#include "server/mesh/extract/extract.h"
#include "server/mesh/mesh.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::codec {

// Times and sizes are first guesses, from a head of five million triangles on two cores.
struct Format {
  MeshFormat format;
  std::string_view media_type;  // application/octet-stream if none is registered
  double milliseconds_per_triangle;
  // The estimated size of the file.
  double (*bytes)(const mesh::SurfaceSize& surface, const MeshParameters& parameters);
  // True if that is exact but for the header, given the vertices and triangles of the file.
  bool (*has_exact_bytes)(const MeshParameters& parameters) = [](const MeshParameters&) {
    return false;
  };
  // The encoder's peak memory without the mesh; an upper estimate.
  std::uint64_t (*memory_bytes)(const mesh::SurfaceSize& surface,
                                const MeshParameters& parameters) =
      [](const mesh::SurfaceSize&, const MeshParameters&) { return std::uint64_t{0}; };
  // True if encoding nearly always yields the mesh's topology.
  bool (*shows_topology)(const MeshParameters& parameters) = [](const MeshParameters&) {
    return false;
  };
  Encoder* encode;  // null for a format that holds files of labels only
  // Null for a format that holds the mesh's triangles and floats exactly, in the file's space; by
  // labels, the triangles of each label's own surface. Other formats round coordinates, GLB unless
  // it has no codec.
  DecodedSurface (*decode)(std::span<const std::byte> file, const mesh::Context& context) = nullptr;
};

// Constant time.
const Format& describe(MeshFormat format);

// True if a job's file of that format rounds coordinates or contains files that do: drc, glb unless
// it has no codec, and a ZIP of drc.
bool rounds(MeshFormat format, const MeshParameters& parameters);

// Calls the format's encoder. Only GLB with distances uses `extracted`. Returns the mesh's topology
// if encoding yields it. Throws Error kInternal for a format that holds files of labels only, and
// as the encoder does.
std::optional<mesh::Topology> encode(const mesh::Mesh& mesh, MeshFormat format,
                                     const Provenance& provenance, const mesh::Context& context,
                                     const Sink& sink,
                                     const mesh::TriangleGrid* extracted = nullptr);

// Calls the format's encoder of all labels in one file. Throws Error kInternal for a format that
// has none, and as the encoder does.
void encode_labels(const LabelledSurface& surface, MeshFormat format, const Provenance& provenance,
                   const mesh::Context& context, const Sink& sink);

// Decodes a file that rounds coordinates. `space` is the space of the file's coordinates. Positions
// of the result are finite and its vertex indices valid. It does not depend on the number of
// threads. Thread safe. Throws Error kInternal if the file is not as our encoders write it or its
// format is exact; kTooLarge as join does; kCancelled.
DecodedSurface decode(std::span<const std::byte> file, MeshFormat format, Space space,
                      const mesh::Context& context);

}  // namespace isomesh::codec
