// A file that rounds coordinates as a mesh that other programs read: decoded with the format's own
// library, never from the encoder's arrays. For measuring the written file. All other formats hold
// the mesh itself (codec/formats.h).
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

// Joins all parts in order; consumes them. Throws Error kTooLarge if 32 bits cannot number the
// vertices, and kCancelled.
DecodedSurface join(std::vector<DecodedSurface>&& parts, const mesh::Context& context);

}  // namespace isomesh::codec
