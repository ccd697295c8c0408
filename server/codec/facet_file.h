// Files that are a head and then equally many bytes for each triangle, so that they can be written
// as the triangles come.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::codec {

struct FacetFile {
  // Throws Error kTooLarge if a file cannot have so many triangles.
  std::vector<std::byte> (*head)(Space space, const LengthUnit& unit, std::uint64_t triangles);
  std::size_t facet_bytes;
  // Writes the triangles [begin, end) of the mesh. Returns the place behind them. Thread safe.
  std::byte* (*write)(const mesh::Mesh& mesh, Space space, std::size_t begin, std::size_t end,
                      std::byte* out);
};

// Null for a format whose encoder needs the surface as a whole.
const FacetFile* facet_file_of(MeshFormat format);

}  // namespace isomesh::codec
