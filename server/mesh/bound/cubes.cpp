#include "server/mesh/bound/cubes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/mesh/bound/chunks.h"

namespace isomesh::mesh::bound {
namespace {

constexpr float kNearSeam = 0.12F;  // of a cube's side

class Cutter {
 public:
  Cutter(const Dims& dims, const CubeCut& cut)
      : cut_(cut), counts_{along(dims.x), along(dims.y), along(dims.z)} {}

  // The last one is for those of no cube.
  std::size_t count() const { return counts_[0] * counts_[1] * counts_[2] + 1; }

  std::uint32_t cube_of(const Tube& tube, const Triangle& triangle) const {
    const auto& [a, b, c] = triangle;
    const Vecf middle =
        (tube.vertices[a].p + tube.vertices[b].p + tube.vertices[c].p) * (1 / (3 * cut_.side));
    const auto is_near = [](float x) { return std::abs(x - std::round(x)) < kNearSeam; };
    const std::size_t rest = count() - 1;
    if (cut_.is_for_seams && !is_near(middle.x) && !is_near(middle.y) && !is_near(middle.z)) {
      return static_cast<std::uint32_t>(rest);
    }
    const float shift = cut_.is_for_seams ? 0.5F : 0;
    const auto cell = [&](float x) { return static_cast<std::size_t>(std::max(0.0F, x + shift)); };
    const std::size_t cube =
        cell(middle.x) + counts_[0] * (cell(middle.y) + counts_[1] * cell(middle.z));
    return static_cast<std::uint32_t>(std::min(cube, rest));
  }

 private:
  std::size_t along(std::uint32_t samples) const {
    return static_cast<std::size_t>(static_cast<float>(samples) / cut_.side) + 2;
  }

  const CubeCut cut_;
  const std::array<std::size_t, 3> counts_;
};

}  // namespace

Cubes cut_cubes(const Dims& dims, const Tube& tube, const CubeCut& cut, const Context& context) {
  const Cutter cutter(dims, cut);
  const std::size_t count = tube.triangles.size();
  // Fewer and larger chunks than elsewhere: each counts the members of all cubes.
  const std::size_t chunks = std::min<std::size_t>(64, chunks_of(count));
  const auto first_of = [&](std::size_t chunk) { return count * chunk / chunks; };
  std::vector<std::uint32_t> cube(count);
  std::vector<std::vector<std::size_t>> next(chunks);
  parallel_for(context, chunks, [&](std::size_t chunk) {
    next[chunk].assign(cutter.count(), 0);
    for (std::size_t t = first_of(chunk); t < first_of(chunk + 1); ++t) {
      cube[t] = cutter.cube_of(tube, tube.triangles[t]);
      ++next[chunk][cube[t]];
    }
  });
  Cubes cubes{std::vector<std::size_t>(cutter.count() + 1, 0), std::vector<std::uint32_t>(count)};
  std::size_t sum = 0;
  for (std::size_t k = 0; k < cutter.count(); ++k) {
    for (auto& of_chunk : next) sum += std::exchange(of_chunk[k], sum);
    cubes.begin[k + 1] = sum;
  }
  parallel_for(context, chunks, [&](std::size_t chunk) {
    for (std::size_t t = first_of(chunk); t < first_of(chunk + 1); ++t) {
      cubes.members[next[chunk][cube[t]]++] = static_cast<std::uint32_t>(t);
    }
  });
  return cubes;
}

}  // namespace isomesh::mesh::bound
