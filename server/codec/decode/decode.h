// Decodes a file that rounds coordinates into a mesh as other programs read it: with the format's
// own library, never from the encoder's arrays. For measuring the written file. Only the program
// that makes meshes links it. All other formats hold the mesh itself (codec/encode.h, `rounds`).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

// In LPS millimetres, without layers. GLB duplicates vertices on the seams of its blocks.
struct DecodedSurface {
  mesh::Buffer<mesh::Vec3> positions;
  mesh::Buffer<mesh::Triangle> triangles;

  mesh::SurfaceView view() const { return {positions.span(), triangles.span()}; }
};

// Decodes drc and glb with libdraco, packed glb with meshoptimizer; of glb the finest level of the
// default scene, its blocks joined. `space` is the space of the file's coordinates. Positions are
// finite and vertex indices valid. The result does not depend on the number of threads. Needs the
// memory of the surface, twice if blocks are joined. Thread safe. Throws Error kInternal if the
// file is not as our encoders write it or has another format; kTooLarge as join does; kCancelled.
DecodedSurface decode(std::span<const std::byte> file, MeshFormat format, Space space,
                      const mesh::Context& context);

// Joins all parts in order; consumes them. Throws Error kTooLarge if 32 bits cannot number the
// vertices, and kCancelled.
DecodedSurface join(std::vector<DecodedSurface>&& parts, const mesh::Context& context);

}  // namespace isomesh::codec
