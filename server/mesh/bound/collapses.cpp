#include "server/mesh/bound/collapses.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "server/mesh/bound/chunks.h"
#include "server/mesh/bound/cubes.h"

namespace isomesh::mesh::bound {
namespace {

constexpr double kBlockTriangles = 6000;

double area_of(const Tube& tube, const Context& context) {
  std::vector<double> areas(chunks_of(tube.triangles.size()), 0);
  for_chunks(context, tube.triangles.size(),
             [&](std::size_t begin, std::size_t end, std::size_t chunk) {
               for (std::size_t t = begin; t < end; ++t) {
                 const auto& [a, b, c] = tube.triangles[t];
                 const Vecf p = tube.vertices[a].p;
                 areas[chunk] +=
                     0.5 * double{length(cross(tube.vertices[b].p - p, tube.vertices[c].p - p))};
               }
             });
  return std::accumulate(areas.begin(), areas.end(), 0.0);
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

}  // namespace isomesh::mesh::bound
