// Meshes made up from bytes: for tests that feed random ones, and for a fuzzer.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/mesh/mesh.h"

namespace isomesh::test {

// A mesh and what to encode it with.
struct MadeUpMesh {
  mesh::Mesh mesh;
  DracoParameters draco;
  // Every edge has two triangles or one, every vertex one fan, and every vertex a triangle.
  bool is_manifold = false;
  // All positions are finite numbers that are not too large.
  bool is_finite = true;
  // Triangles may name vertices of other layers than theirs.
  bool has_wrong_layers = false;
};

// Iso-surfaces of noise, sheets and tubes with holes, tori, many small pieces, surfaces that touch
// at vertices, and triangles thrown together: whatever the bytes say. Missing bytes are zeros.
// Small: at most some thousand triangles.
MadeUpMesh mesh_from_bytes(std::span<const std::byte> bytes);

// Bytes for that, of a sequence that a number starts.
std::vector<std::byte> random_bytes(std::uint64_t seed, std::size_t count);

}  // namespace isomesh::test
