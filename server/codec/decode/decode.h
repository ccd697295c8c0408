// Bytes of a file format -> mesh, as a stranger who is given the file reads it: by the formats' own
// libraries where there are some, and never from the arrays that the file was made of. For
// measuring what was written; only the program that makes meshes has it.
#pragma once

#include <cstddef>
#include <map>
#include <span>

#include "proto/types.h"
#include "server/mesh/buffer.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"
#include "server/mesh/surface_view.h"

namespace isomesh::codec {

// Millimetres in LPS; in no layers. Whether vertices that several triangles have in common are one
// is up to the format: in GLB not across the blocks, in 3MF not across the labels.
struct DecodedSurface {
  mesh::Buffer<mesh::Vec3> positions;
  mesh::Buffer<mesh::Triangle> triangles;

  mesh::SurfaceView view() const { return {positions.span(), triangles.span()}; }
};

// What is in a file that one of our encoders wrote:
//  - drc, glb: what libdraco's decoder makes of it; of glb the finest level of the default scene,
//    block by block, side by side.
//  - stl: corners at the same place become one vertex, in the order of the file.
//  - ply, obj, 3mf, off, vtk, vtp, gii: the file's vertices and triangles; with labels those of all
//    of them, so that a wall is there for each label that it belongs to.
//  - zip: all its files, one after the other; see decode_zip.
// `space` is that of the file's coordinates, of a ZIP that of the files in it for which space_of
// does not say another one. Positions are finite and triangles name vertices that are there. The
// same for any number of threads. Takes what the surface takes, and as much again for parts that
// are put together; of stl 40 bytes a triangle and of zip the unpacked files beside it. Thread
// safe. Throws Error kInternal with what is wrong of a file that is not as our encoders write it,
// kTooLarge where 32 bits cannot number the vertices, and kCancelled.
DecodedSurface decode(std::span<const std::byte> file, MeshFormat format, Space space,
                      const mesh::Context& context);

// The files in a ZIP of labels, those of each format put together. Throws as decode does.
std::map<MeshFormat, DecodedSurface> decode_zip(std::span<const std::byte> file, Space space,
                                                const mesh::Context& context);

}  // namespace isomesh::codec
