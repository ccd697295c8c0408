#include "server/mesh/collapse/collapses.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "server/mesh/parallel.h"

namespace isomesh::mesh::collapse {
namespace {

constexpr double kBlockTriangles = 6000;

double area_of(const Tube& tube, const Context& context) {
  std::vector<double> areas(chunks_of(tube.triangles.size()), 0);
  for_each(context, tube.triangles.size(), [&](std::size_t t) {
    const auto& [a, b, c] = tube.triangles[t];
    const Vecf p = tube.vertices[a].p;
    areas[t / kChunk] +=
        0.5 * double{length(cross(tube.vertices[b].p - p, tube.vertices[c].p - p))};
  });
  return std::accumulate(areas.begin(), areas.end(), 0.0);
}

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

// `dims`: of a lattice that the tube is in.
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

// Numbers the vertices that a block's triangles name, in ascending order.
class Names {
 public:
  Names(const Tube& tube, std::span<const std::uint32_t> members) {
    for (const std::size_t t : members) {
      names_.insert(names_.end(), tube.triangles[t].begin(), tube.triangles[t].end());
    }
    std::ranges::sort(names_);
    names_.erase(std::unique(names_.begin(), names_.end()), names_.end());
  }

  std::uint32_t number_of(std::uint32_t name) const {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(names_, name) - names_.begin());
  }
  const std::vector<std::uint32_t>& names() const { return names_; }

 private:
  std::vector<std::uint32_t> names_;
};

class Rounds {
 public:
  Rounds(const CollapseSurroundings& around, std::uint64_t least, const Context& context,
         Tube& tube)
      : around_(around),
        least_(least),
        context_(context),
        tube_(tube),
        is_seam_(tube.vertices.size(), 0) {}

  void run() {
    if (tube_.triangles.empty()) return;
    const double mean = area_of(tube_, context_) / static_cast<double>(tube_.triangles.size());
    const auto side = static_cast<float>(std::max(std::sqrt(kBlockTriangles * mean), 1.0));
    // The second time for what was at a seam the first time.
    for (const bool is_for_seams : {false, true}) collapse({side, is_for_seams});
  }

 private:
  struct Result {
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> seams;
  };

  void collapse(const CubeCut& cut) {
    const double share = share_to_keep();
    if (share >= 1) return;
    const Cubes cubes = cut_cubes(around_.field.dims, tube_, cut, context_);
    std::vector<Result> results(cubes.size());
    parallel_for(context_, cubes.size(), [&](std::size_t cube) {
      const bool is_rest = cube + 1 == cubes.size();
      results[cube] =
          is_rest ? kept(cubes.of(cube)) : collapsed(cubes.of(cube), share, cut.is_for_seams);
    });
    take(results);
  }

  void take(const std::vector<Result>& results) {
    std::vector<std::size_t> begin = {0};
    for (const Result& result : results) begin.push_back(begin.back() + result.triangles.size());
    tube_.triangles.resize(begin.back());
    parallel_for(context_, results.size(), [&](std::size_t k) {
      std::ranges::copy(results[k].triangles,
                        tube_.triangles.begin() + static_cast<std::ptrdiff_t>(begin[k]));
    });
    for (const Result& result : results) {
      for (const std::uint32_t v : result.seams) is_seam_[v] = 1;
    }
  }

  // Blocks give up equal shares.
  double share_to_keep() const {
    return static_cast<double>(least_) / static_cast<double>(tube_.triangles.size());
  }

  Result kept(std::span<const std::uint32_t> members) const {
    Result result;
    for (const std::size_t t : members) result.triangles.push_back(tube_.triangles[t]);
    return result;
  }

  Result collapsed(std::span<const std::uint32_t> members, double share, bool is_for_seams) {
    const Names names(tube_, members);
    Block block = block_of(members, is_for_seams, names);
    collapse_block(around_, static_cast<std::size_t>(share * static_cast<double>(members.size())),
                   block);
    Result result;
    result.triangles.reserve(block.triangles.size());
    for (const auto& [a, b, c] : block.triangles) {
      result.triangles.push_back({names.names()[a], names.names()[b], names.names()[c]});
    }
    for (std::size_t v = 0; v < names.names().size(); ++v) {
      const std::uint32_t name = names.names()[v];
      if (block.stays[v] != 0) {
        result.seams.push_back(name);
      } else {
        tube_.vertices[name] = block.vertices[v];  // no other block has it
      }
    }
    return result;
  }

  Block block_of(std::span<const std::uint32_t> members, bool is_for_seams,
                 const Names& names) const {
    Block block;
    block.triangles.reserve(members.size());
    for (const std::size_t t : members) {
      const auto& [a, b, c] = tube_.triangles[t];
      block.triangles.push_back({names.number_of(a), names.number_of(b), names.number_of(c)});
    }
    block.first.assign(names.names().size(), is_for_seams ? 0 : 1);
    for (const std::uint32_t v : names.names()) {
      block.vertices.push_back(tube_.vertices[v]);
      block.stays.push_back(tube_.border[v]);
      block.planes.push_back(tube_.planes[v]);
    }
    for (const auto& [a, b, c] : block.triangles) {
      const auto is_seam = [&](std::uint32_t v) { return is_seam_[names.names()[v]] != 0; };
      if (is_seam(a) || is_seam(b) || is_seam(c))
        block.first[a] = block.first[b] = block.first[c] = 1;
    }
    return block;
  }

  const CollapseSurroundings& around_;
  const std::uint64_t least_;
  const Context& context_;
  Tube& tube_;
  std::vector<std::uint8_t> is_seam_;  // of each vertex: on the boundary of a block before
};

}  // namespace

void collapse_edges(const CollapseSurroundings& around, std::uint64_t least, const Context& context,
                    Tube& tube) {
  Rounds(around, least, context, tube).run();
}

}  // namespace isomesh::mesh::collapse
