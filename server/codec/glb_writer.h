// The container of a GLB file, and what its encoders share. Private to this folder.
#pragma once

#include <cstddef>
#include <span>

#include "server/codec/draco_chunk.h"
#include "server/codec/encode.h"
#include "server/codec/glb_document.h"
#include "server/codec/walked_file.h"
#include "server/mesh/topology/topology.h"

namespace isomesh::codec {

inline bool is_plain(const MeshParameters& parameters) {
  return parameters.glb_codec == GlbCodec::kNone;
}

inline bool is_solid(const mesh::Topology& topology) {
  return topology.boundary_edges == 0 && topology.manifold && topology.oriented;
}

// Throws Error kTooLarge if a file of so many bytes cannot be.
void check_glb_size(std::size_t bytes, const MeshParameters& parameters);

// Adds the block as a Draco stream, or as arrays, to those of a level. `number` is its place there,
// and there is one already. On one thread.
void encode_glb_block(const mesh::Mesh& mesh, const Block& block, const Grid& grid,
                      const VertexData& data, const MeshParameters& parameters,
                      const mesh::Context& context, std::size_t number, GlbLevel& level);

// Writes the file. Reports the share of its binary data that is written.
void write_glb(std::span<const GlbPart> parts, const Grid& grid, const Provenance& provenance,
               const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
