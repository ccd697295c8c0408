// Assembles the parts of a Draco stream. Private to this folder.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "server/codec/draco/corners.h"
#include "server/codec/draco/grid.h"
#include "server/codec/draco/quantise.h"
#include "server/codec/draco/raw_symbols.h"
#include "server/codec/draco/traversal.h"

namespace isomesh::codec::edgebreaker {

struct StreamParts {
  const Traversal& traversal;
  std::uint32_t faces = 0;
  std::uint32_t vertices = 0;  // in faces
  CodedValues residuals;
  std::optional<CodedValues> normals;
  Extent extent;
  const Grid& grid;
};

// Returns a stream of Draco's bitstream 2.2: a triangle mesh by edgebreaker with positions and, if
// given, normals as vertex attributes.
std::vector<std::byte> assemble(const StreamParts& parts);

}  // namespace isomesh::codec::edgebreaker
