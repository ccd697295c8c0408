// Cubes whose triangles are simplified together, several at once; private to this folder.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <utility>
#include <vector>

#include "server/mesh/collapse/vec.h"
#include "server/mesh/context.h"
#include "server/mesh/mesh.h"

namespace isomesh::mesh::collapse {

// Larger blocks have fewer seams, smaller ones stay in the cache.
inline constexpr double kBlockTriangles = 6000;

inline constexpr std::uint8_t kStays = 1;
inline constexpr std::uint8_t kIsElsewhere = 2;  // too: has further triangles

// Some triangles of a surface with vertices numbered anew.
struct Patch {
  std::vector<std::uint32_t> names;  // of each vertex in the surface; ascending
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> numbers;  // of each triangle; none if the surface has none
  std::vector<std::uint8_t> stays;     // of each vertex: kStays, kIsElsewhere; at first 0
  std::vector<std::uint8_t> first;     // of each vertex: to begin with
};

// How cubes are cut, in the unit of places.
struct CubeCut {
  float side = 1;
  bool is_shifted = false;    // by half a side
  bool is_for_seams = false;  // only what is near the seams of those that are not shifted
};

// A surface on its way to fewer triangles.
class Patches {
 public:
  // The places of the `vertices` are neither negative nor beyond `size`. `numbers`: as
  // Patch::numbers. Both lists are changed, and the rest is only referred to.
  Patches(std::vector<Triangle>& triangles, std::vector<std::uint32_t>& numbers,
          std::size_t vertices, std::function<Vecf(std::uint32_t)> place, Vecf size)
      : triangles_(triangles),
        numbers_(numbers),
        place_(std::move(place)),
        size_(size),
        is_seam_(vertices, 0) {}

  // Calls collapse(patch) for each cube, several at once. It leaves fewer triangles, with their
  // numbers, and sets `stays` for the vertices that others may have too. For seams, the vertices
  // to begin with are those that stayed before and their neighbours. Does not depend on the number
  // of threads. Throws Error kCancelled.
  void collapse(const CubeCut& cut, const Context& context,
                const std::function<void(Patch&)>& collapse);

 private:
  struct Result {
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> numbers;
    std::vector<std::uint32_t> seams;
  };

  Patch patch_of(std::span<const std::uint32_t> members, bool is_for_seams) const;
  void take(const std::vector<Result>& results, const Context& context);

  std::vector<Triangle>& triangles_;
  std::vector<std::uint32_t>& numbers_;
  const std::function<Vecf(std::uint32_t)> place_;
  const Vecf size_;
  std::vector<std::uint8_t> is_seam_;  // of each vertex: stayed in a block before
};

}  // namespace isomesh::mesh::collapse
