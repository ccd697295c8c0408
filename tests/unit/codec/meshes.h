// Meshes for the codecs, and what they are encoded to.
#pragma once

#include <string>
#include <vector>

#include "server/codec/encode.h"
#include "server/mesh/mesh.h"
#include "tests/support/kernels.h"

namespace isomesh::test {

struct NamedMesh {
  std::string name;
  mesh::Mesh mesh;
};

// Closed and open, of one piece and of many, flat, tiny, far from the origin.
std::vector<NamedMesh> meshes_to_encode();

// A surface of so many triangles that no codec can hold them in one block.
mesh::Mesh large_mesh();

// A sphere of several of GLB's blocks; midpoints, so that no two vertices share a place on the
// grid.
mesh::Mesh several_blocks();

// All but ZIP, which holds labels.
std::vector<MeshFormat> formats_of_a_surface();

// Those that round nothing.
std::vector<MeshFormat> exact_formats();

// For a mesh whose files are to be in that space.
codec::Provenance provenance_in(Space space);

// All bytes that an encoder hands to its sink.
std::string encoded(const mesh::Mesh& mesh, MeshFormat format, const DracoParameters& draco = {});
std::string encoded(const mesh::Mesh& mesh, MeshFormat format, const codec::Provenance& provenance);

}  // namespace isomesh::test
