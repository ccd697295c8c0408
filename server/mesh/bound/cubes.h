// The triangles of a tube by cubes of space; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "server/mesh/bound/tube.h"
#include "server/mesh/context.h"
#include "server/mesh/lattice/lattice.h"

namespace isomesh::mesh::bound {

// Each cube's triangles in their order, and last those that no cube takes.
struct Cubes {
  std::vector<std::size_t> begin;
  std::vector<std::uint32_t> members;

  std::size_t size() const { return begin.size() - 1; }
  std::span<const std::uint32_t> of(std::size_t cube) const {
    return std::span(members).subspan(begin[cube], begin[cube + 1] - begin[cube]);
  }
};

// How cubes are cut; in numbers of samples.
struct CubeCut {
  float side = 1;
  bool is_for_seams = false;  // half a side on, and only of what is near the seams of the others
};

// `dims`: of a lattice that the tube is in. Throws Error kCancelled.
Cubes cut_cubes(const Dims& dims, const Tube& tube, const CubeCut& cut, const Context& context);

}  // namespace isomesh::mesh::bound
