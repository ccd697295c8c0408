// Bytes of a file that rounds coordinates -> mesh, as another program reads it: by the formats' own
// libraries, and never from the arrays that the file was made of. For measuring what was written;
// only the program that makes meshes has it. All other formats hold the mesh itself
// (codec/encode.h, `rounds`).
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

// Millimetres in LPS; in no layers. In GLB, vertices on the seam of two blocks are there twice.
struct DecodedSurface {
  mesh::Buffer<mesh::Vec3> positions;
  mesh::Buffer<mesh::Triangle> triangles;

  mesh::SurfaceView view() const { return {positions.span(), triangles.span()}; }
};

// What libdraco's decoder makes of a file of the format drc or glb, or meshoptimizer's of a packed
// glb; of glb the finest level of the default scene, its blocks joined. `space` is that of the
// file's coordinates. Positions are finite and triangles name vertices that are there. The same for
// any number of threads. Takes what the surface takes, and as much again for blocks that are
// joined. Thread safe. Throws Error kInternal if the file is not as our encoders write it, or of
// another format; kTooLarge as join does; and kCancelled.
DecodedSurface decode(std::span<const std::byte> file, MeshFormat format, Space space,
                      const mesh::Context& context);

// All parts as one surface, in their order; takes their memory. Throws Error kTooLarge if 32 bits
// cannot number the vertices, and kCancelled.
DecodedSurface join(std::vector<DecodedSurface>&& parts, const mesh::Context& context);

}  // namespace isomesh::codec
