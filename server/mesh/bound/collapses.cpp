#include "server/mesh/bound/collapses.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "server/mesh/bound/collapse_block.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh::bound {
namespace {

constexpr double kBlockTriangles = 6000;
constexpr float kNearSeam = 0.12F;  // of a cube's side
constexpr int kRounds = 2;          // the second for what was at a seam in the first

// The triangles in cubes of space, and last those that no cube of the round takes.
struct Cubes {
  std::vector<std::size_t> begin;
  std::vector<std::size_t> members;

  std::size_t size() const { return begin.size() - 1; }
};

double area_of(const Tube& tube) {
  double area = 0;
  for (const auto& [a, b, c] : tube.triangles) {
    const Vecf p = tube.vertices[a].p;
    area += 0.5 * double{length(cross(tube.vertices[b].p - p, tube.vertices[c].p - p))};
  }
  return area;
}

Cubes cut_cubes(const Field& field, const Tube& tube, float side, int round) {
  const auto along = [&](std::uint32_t samples) {
    return static_cast<std::size_t>(static_cast<float>(samples) / side) + 2;
  };
  const std::array<std::size_t, 3> counts = {along(field.dims.x), along(field.dims.y),
                                             along(field.dims.z)};
  const std::size_t rest = counts[0] * counts[1] * counts[2];
  const float shift = round == 0 ? 0 : 0.5F;
  const auto is_near = [](float x) { return std::abs(x - std::round(x)) < kNearSeam; };
  const auto cell = [&](float x) { return static_cast<std::size_t>(std::max(0.0F, x + shift)); };
  std::vector<std::size_t> cube(tube.triangles.size());
  Cubes cubes{std::vector<std::size_t>(rest + 2, 0), std::vector<std::size_t>(cube.size())};
  for (std::size_t t = 0; t < cube.size(); ++t) {
    const auto& [a, b, c] = tube.triangles[t];
    const Vecf middle =
        (tube.vertices[a].p + tube.vertices[b].p + tube.vertices[c].p) * (1 / (3 * side));
    const bool is_rest =
        round > 0 && !is_near(middle.x) && !is_near(middle.y) && !is_near(middle.z);
    cube[t] =
        is_rest
            ? rest
            : std::min(cell(middle.x) + counts[0] * (cell(middle.y) + counts[1] * cell(middle.z)),
                       rest);
    ++cubes.begin[cube[t] + 1];
  }
  std::partial_sum(cubes.begin.begin(), cubes.begin.end(), cubes.begin.begin());
  std::vector<std::size_t> next(cubes.begin.begin(), cubes.begin.end() - 1);
  for (std::size_t t = 0; t < cube.size(); ++t) cubes.members[next[cube[t]]++] = t;
  return cubes;
}

class Rounds {
 public:
  Rounds(const Field& field, const Metric& metric, const CollapseOptions& options,
         const Context& context, Tube& tube)
      : field_(field),
        metric_(metric),
        options_(options),
        context_(context),
        tube_(tube),
        is_seam_(tube.vertices.size(), 0) {}

  void run() {
    if (tube_.triangles.empty()) return;
    const double side =
        std::sqrt(kBlockTriangles * area_of(tube_) / static_cast<double>(tube_.triangles.size()));
    for (int round = 0; round < kRounds; ++round) {
      collapse(cut_cubes(field_, tube_, static_cast<float>(std::max(side, 1.0)), round), round);
    }
  }

 private:
  struct Result {
    std::vector<Triangle> triangles;
    std::vector<std::uint32_t> seams;
  };

  void collapse(const Cubes& cubes, int round) {
    const double share = share_to_keep();
    if (share >= 1) return;
    std::vector<Result> results(cubes.size());
    parallel_for(context_, cubes.size(), [&](std::size_t cube) {
      const std::span members(cubes.members.data() + cubes.begin[cube],
                              cubes.begin[cube + 1] - cubes.begin[cube]);
      const bool is_rest = cube + 1 == cubes.size();
      results[cube] = is_rest ? kept(members) : collapsed(members, share, round);
    });
    tube_.triangles.clear();
    for (const Result& result : results) {
      tube_.triangles.insert(tube_.triangles.end(), result.triangles.begin(),
                             result.triangles.end());
      for (const std::uint32_t v : result.seams) is_seam_[v] = 1;
    }
  }

  // Blocks give up equal shares.
  double share_to_keep() const {
    return static_cast<double>(options_.triangles) / static_cast<double>(tube_.triangles.size());
  }

  Result kept(std::span<const std::size_t> members) const {
    Result result;
    for (const std::size_t t : members) result.triangles.push_back(tube_.triangles[t]);
    return result;
  }

  Result collapsed(std::span<const std::size_t> members, double share, int round) {
    std::vector<std::uint32_t> names;  // of the block's vertices in the tube
    for (const std::size_t t : members) {
      names.insert(names.end(), tube_.triangles[t].begin(), tube_.triangles[t].end());
    }
    std::ranges::sort(names);
    names.erase(std::unique(names.begin(), names.end()), names.end());
    Block block = block_of(members, names, round);
    collapse_block(field_, metric_, options_.reach_mm,
                   static_cast<std::size_t>(share * static_cast<double>(members.size())), block);
    Result result;
    for (const auto& [a, b, c] : block.triangles) {
      result.triangles.push_back({names[a], names[b], names[c]});
    }
    for (std::size_t v = 0; v < names.size(); ++v) {
      if (block.stays[v] != 0) {
        result.seams.push_back(names[v]);
      } else {
        tube_.vertices[names[v]] = block.vertices[v];  // no other block has it
      }
    }
    return result;
  }

  Block block_of(std::span<const std::size_t> members, const std::vector<std::uint32_t>& names,
                 int round) const {
    Block block;
    for (const std::uint32_t v : names) {
      block.vertices.push_back(tube_.vertices[v]);
      block.stays.push_back(tube_.border[v]);
      block.planes.push_back(tube_.planes[v]);
    }
    block.first.assign(names.size(), round == 0 ? 1 : 0);
    for (const std::size_t t : members) {
      const Triangle& whole = tube_.triangles[t];
      const bool is_first = std::ranges::any_of(whole, [&](auto v) { return is_seam_[v] != 0; });
      Triangle triangle;
      for (std::size_t i = 0; i < 3; ++i) {
        triangle[i] =
            static_cast<std::uint32_t>(std::ranges::lower_bound(names, whole[i]) - names.begin());
        if (is_first) block.first[triangle[i]] = 1;
      }
      block.triangles.push_back(triangle);
    }
    return block;
  }

  const Field& field_;
  const Metric& metric_;
  const CollapseOptions& options_;
  const Context& context_;
  Tube& tube_;
  std::vector<std::uint8_t> is_seam_;  // of each vertex: on the boundary of a block before
};

}  // namespace

void collapse_edges(const Field& field, const Metric& metric, const CollapseOptions& options,
                    const Context& context, Tube& tube) {
  Rounds(field, metric, options, context, tube).run();
}

}  // namespace isomesh::mesh::bound
