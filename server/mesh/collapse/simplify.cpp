#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify_block.h"
#include "server/mesh/collapse/simplify_cubes.h"
#include "server/mesh/collapse/simplify_last.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/collapse/simplify_lines.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

constexpr int kMostRounds = 6;
constexpr int kMostRepairs = 12;  // of seams; the second half leaves blocks as they were
constexpr std::uint32_t kNoBlock = ~std::uint32_t{0};

// Numbers of things, one group after the other, in their order within a group.
struct Groups {
  std::vector<std::uint64_t> begins;
  std::vector<std::uint32_t> members;

  template <class GroupOf>
  Groups(std::size_t groups, std::size_t things, GroupOf group_of) : begins(groups + 2, 0) {
    // Shifted by one: while the groups are filled, a begin is where its group goes on.
    for (std::size_t n = 0; n < things; ++n) {
      if (group_of(n) != kNoBlock) ++begins[group_of(n) + 2];
    }
    std::partial_sum(begins.begin(), begins.end(), begins.begin());
    members.resize(begins.back());
    for (std::size_t n = 0; n < things; ++n) {
      if (group_of(n) != kNoBlock) {
        members[begins[group_of(n) + 1]++] = static_cast<std::uint32_t>(n);
      }
    }
    begins.pop_back();
  }

  std::span<const std::uint32_t> of(std::size_t group) const {
    return std::span(members).subspan(begins[group], begins[group + 1] - begins[group]);
  }
};

class Simplifier {
 public:
  // `walls` are whose mesh it is, if any.
  Simplifier(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
             const SeparatingSurface* walls)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        walls_(walls),
        original_(options.before.empty() ? mesh.positions.span() : options.before,
                  mesh.triangles.span()),
        extent_(measure_extent(mesh, quiet_)),
        cubes_(extent_, mesh.triangles.size()),
        current_(mesh.triangles.begin(), mesh.triangles.end()) {
    if (walls != nullptr) sides_.assign(walls->sides.begin(), walls->sides.end());
    if (!std::isfinite(options.max_error_mm)) return;
    grid_.emplace(original_, quiet_);
    const std::size_t vertices = mesh.positions.size();
    homes_.assign(vertices + current_.size(), TriangleGrid::kNone);
    for (std::size_t t = current_.size(); t-- > 0;) {
      for (const std::uint32_t vertex : current_[t]) homes_[vertex] = static_cast<std::uint32_t>(t);
      homes_[vertices + t] = static_cast<std::uint32_t>(t);
    }
  }

  SimplificationEffect run() {
    effect_.triangles_before = current_.size();
    for (int round = 0; walls_ != nullptr && round < 2 && !is_enough(); ++round) {
      simplify_lines_of(round);
    }
    for (int round = 0; round < kMostRounds; ++round) {
      const std::size_t before = current_.size();
      if (is_enough()) break;
      // Cubes grow with the triangles, so that in the end few seams are left to keep them.
      if (options_.triangles > 0) cubes_ = Cubes(extent_, before);
      run_round(round);
      if (round == 0) continue;
      // The second round is for the seams of the first; more are for a number of triangles, as long
      // as they come nearer to it.
      if (options_.triangles == 0) break;
      if (10 * (before - current_.size()) < before - options_.triangles) break;
    }
    effect_.reached_triangles = options_.triangles == 0 || is_enough();
    if (!effect_.reached_triangles) conclude();
    effect_.triangles_after = current_.size();
    return effect_;
  }

  // The remaining triangles, and their sides.
  std::vector<Triangle>& triangles() { return current_; }
  std::vector<WallSides>& sides() { return sides_; }

 private:
  bool is_enough() const { return options_.triangles > 0 && current_.size() <= options_.triangles; }

  // Blocks have not come to as few triangles as was aimed at.
  void conclude() {
    if (!grid_) {
      simplify_last(options_.triangles, options_.held, quiet_, mesh_, current_, sides_);
      effect_.reached_triangles = is_enough();
    }
    effect_.is_least =
        !effect_.reached_triangles && (!grid_ || is_least(options_.held, mesh_, current_, sides_));
  }

  std::uint32_t cube_of(std::size_t triangle, int round) const {
    const SurfaceView view(mesh_.positions.span(), {&current_[triangle], 1});
    const Point centre = measured_point(view, mesh_.positions.size());
    const bool is_left_out =
        round > 0 && options_.triangles == 0 && !cubes_.is_near_seam(centre, round);
    return is_left_out ? kNoBlock : cubes_.at(centre, round);
  }

  // The cube of each triangle; kNoBlock if this round leaves the triangle out.
  std::vector<std::uint32_t> cubes_of_triangles(int round) const {
    std::vector<std::uint32_t> cubes(current_.size());
    constexpr std::size_t kPerTask = 1 << 15;
    for_each(
        quiet_, cubes.size(), [&](std::size_t t) { cubes[t] = cube_of(t, round); }, kPerTask);
    return cubes;
  }

  // The triangles and measured points of each block.
  class Blocks {
   public:
    // `blocks`: of each triangle.
    Blocks(const Simplifier& of, std::size_t count, std::span<const std::uint32_t> blocks)
        : of_(of),
          triangles_(count, blocks.size(), [&](std::size_t t) { return blocks[t]; }),
          points_(count, of.homes_.size(),
                  [&](std::size_t n) {
                    const std::uint32_t home = of.homes_[n];
                    return home == TriangleGrid::kNone ? kNoBlock : blocks[home];
                  }),
          place_(blocks.size()) {
      for (std::size_t b = 0; b < count; ++b) {
        const auto members = triangles_.of(b);
        for (std::size_t n = 0; n < members.size(); ++n) {
          place_[members[n]] = static_cast<std::uint32_t>(n);
        }
      }
    }

    SurfaceBlock operator()(std::size_t b) const {
      SurfaceBlock block;
      for (const std::uint32_t t : triangles_.of(b)) {
        block.triangles.push_back(of_.current_[t]);
        if (of_.walls_ != nullptr) block.sides.push_back(of_.sides_[t]);
      }
      for (const std::uint32_t point : points_.of(b)) {
        block.points.push_back(point);
        block.homes.push_back(place_[of_.homes_[point]]);
      }
      return block;
    }

   private:
    const Simplifier& of_;
    Groups triangles_;
    Groups points_;
    std::vector<std::uint32_t> place_;  // of a triangle within its block
  };

  // Simplifies the junction curves within each cube.
  void simplify_lines_of(int round) {
    const std::vector<std::uint32_t> cubes = cubes_of_triangles(round);
    const std::vector<std::uint8_t> is_free = vertices_of_one_block(cubes);
    const Blocks block_from(*this, cubes_.count(), cubes);
    std::vector<SurfaceBlock> results(cubes_.count());
    parallel_for(quiet_, results.size(), [&](std::size_t b) {
      results[b] = block_from(b);
      simplify_lines(goal(), is_free, results[b]);
    });
    take(cubes, results);
  }

  // Flags of those vertices that have all their triangles in the same one.
  std::vector<std::uint8_t> vertices_of_one_block(std::span<const std::uint32_t> blocks) const {
    std::vector<std::uint32_t> owner(mesh_.positions.size(), kNoBlock);
    std::vector<std::uint8_t> is_of_one(owner.size(), 1);
    for (std::size_t t = 0; t < current_.size(); ++t) {
      for (const std::uint32_t vertex : current_[t]) {
        if (owner[vertex] == kNoBlock) owner[vertex] = blocks[t];
        if (blocks[t] == kNoBlock || owner[vertex] != blocks[t]) is_of_one[vertex] = 0;
      }
    }
    return is_of_one;
  }

  void run_round(int round) {
    std::vector<std::uint32_t> blocks = cubes_of_triangles(round);
    std::size_t count = cubes_.count();
    if (walls_ != nullptr) count = split_by_sides(blocks);
    const Blocks block_from(*this, count, blocks);
    std::vector<SurfaceBlock> results(count);
    simplify_blocks(round, block_from, results);
    settle_seams(block_from, edges_beside(blocks), results);
    take(blocks, results);
  }

  // Makes a block of each wall in each cube, so that a block has two sides; returns their number.
  // Lines are boundaries of blocks then, which stay.
  std::size_t split_by_sides(std::vector<std::uint32_t>& blocks) const {
    const Groups cubes(cubes_.count(), blocks.size(), [&](std::size_t t) { return blocks[t]; });
    const auto key = [&](std::uint32_t t) {
      return std::uint32_t{sides_[t].front} << 16 | sides_[t].back;
    };
    std::uint32_t next = 0;
    std::vector<std::uint32_t> members;
    for (std::size_t cube = 0; cube < cubes_.count(); ++cube) {
      const auto all = cubes.of(cube);
      members.assign(all.begin(), all.end());
      std::ranges::stable_sort(members, {}, key);
      for (std::size_t n = 0; n < members.size(); ++n) {
        if (n > 0 && key(members[n]) != key(members[n - 1])) ++next;
        blocks[members[n]] = next;
      }
      if (!members.empty()) ++next;
    }
    return next;
  }

  BlockGoal goal() const {
    const double share = options_.triangles == 0
                             ? 0
                             : static_cast<double>(options_.triangles) /
                                   static_cast<double>(std::max<std::size_t>(1, current_.size()));
    return {mesh_, original_,    grid_ ? &*grid_ : nullptr, options_.max_error_mm,
            share, options_.held};
  }

  void simplify_blocks(int round, const Blocks& block_from, std::vector<SurfaceBlock>& results) {
    std::atomic<std::uint64_t> blocks = 0;
    std::atomic<std::uint64_t> repeated = 0;
    std::atomic<std::uint64_t> taken_back = 0;
    const Context context = round == 0 ? context_.part(0, 0.7) : context_.part(0.7, 1);
    parallel_for(context, results.size(), [&](std::size_t b) {
      results[b] = block_from(b);
      if (results[b].triangles.empty()) return;
      const BlockOutcome outcome = simplify_block(goal(), {}, results[b]);
      ++blocks;
      repeated += outcome.repeated;
      taken_back += outcome.is_taken_back ? 1 : 0;
    });
    effect_.blocks += blocks;
    effect_.repeated += repeated;
    effect_.taken_back += taken_back;
  }

  // An edge of one label's own surface, and the block that has triangles there.
  struct BlockEdge {
    SeamEdge edge;
    std::uint32_t block = 0;
    std::uint32_t label = 0;

    std::array<std::uint32_t, 3> key() const { return {edge.low, edge.high, label}; }
  };

  // Once for each label whose surface has it.
  void add_edge(const SeamEdge& edge, std::uint32_t block, const WallSides& sides,
                std::vector<BlockEdge>& edges) const {
    if (walls_ == nullptr) return edges.push_back({edge, block, 0});
    walls_->parts.visit_labels(sides.front, sides.back, [&](std::size_t label, bool) {
      edges.push_back({edge, block, static_cast<std::uint32_t>(label)});
    });
  }

  // The edges of triangles in no block, between vertices that blocks have too: an earlier round may
  // have made them.
  std::vector<BlockEdge> edges_beside(std::span<const std::uint32_t> blocks) const {
    std::vector<bool> is_of_block(mesh_.positions.size(), false);
    for (std::size_t t = 0; t < current_.size(); ++t) {
      if (blocks[t] == kNoBlock) continue;
      for (const std::uint32_t vertex : current_[t]) is_of_block[vertex] = true;
    }
    std::vector<BlockEdge> edges;
    for (std::size_t t = 0; t < current_.size(); ++t) {
      if (blocks[t] != kNoBlock) continue;
      const auto& [a, b, c] = current_[t];
      for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)}) {
        if (!is_of_block[from] || !is_of_block[to]) continue;
        const WallSides sides = walls_ == nullptr ? WallSides{} : sides_[t];
        add_edge({std::min(from, to), std::max(from, to), 1}, kNoBlock, sides, edges);
      }
    }
    return edges;
  }

  // Edges between seam vertices that have more than two triangles although none had before: two
  // blocks, or a block and an earlier round, have each made the same edge. Those of the blocks that
  // made them. `beside` are what edges_beside gives.
  std::vector<BlockEdge> crowded_edges(const std::vector<BlockEdge>& beside,
                                       const std::vector<SurfaceBlock>& results) const {
    std::vector<std::vector<SeamEdge>> of_blocks(results.size());
    parallel_for(quiet_, results.size(),
                 [&](std::size_t b) { of_blocks[b] = seam_edges(results[b].triangles); });
    std::vector<BlockEdge> edges = beside;
    for (std::uint32_t b = 0; b < of_blocks.size(); ++b) {
      const WallSides sides = results[b].sides.empty() ? WallSides{} : results[b].sides.front();
      for (const SeamEdge& edge : of_blocks[b]) add_edge(edge, b, sides, edges);
    }
    std::ranges::stable_sort(edges, {}, &BlockEdge::key);
    std::vector<BlockEdge> crowded;
    for (std::size_t begin = 0; begin < edges.size();) {
      std::size_t end = begin;
      std::uint32_t all = 0;
      for (; end < edges.size() && edges[end].key() == edges[begin].key(); ++end) {
        all += edges[end].edge.triangles;
      }
      for (; begin < end; ++begin) {
        if (all > 2 && edges[begin].edge.triangles > 1) crowded.push_back(edges[begin]);
      }
    }
    return crowded;
  }

  // Simplifies the blocks again that made such edges, without them; in the end leaves them as they
  // were, which had none.
  void settle_seams(const Blocks& block_from, const std::vector<BlockEdge>& beside,
                    std::vector<SurfaceBlock>& results) {
    std::vector<std::vector<std::uint32_t>> held(results.size());
    for (int attempt = 0; attempt < kMostRepairs; ++attempt) {
      const std::vector<BlockEdge> crowded = crowded_edges(beside, results);
      if (crowded.empty()) return;
      std::vector<std::uint32_t> blocks;
      for (const auto& [edge, block, label] : crowded) {
        if (held[block].empty() || blocks.empty() || blocks.back() != block)
          blocks.push_back(block);
        held[block].insert(held[block].end(), {edge.low, edge.high});
      }
      std::ranges::sort(blocks);
      blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
      const bool is_given_up = attempt >= kMostRepairs / 2;
      parallel_for(quiet_, blocks.size(), [&](std::size_t n) {
        const std::uint32_t b = blocks[n];
        results[b] = block_from(b);
        if (!is_given_up) simplify_block(goal(), held[b], results[b]);
      });
      (is_given_up ? effect_.taken_back : effect_.repeated) += blocks.size();
    }
    // Crowded edges that were there before the first round stay.
  }

  // Appends the blocks' results to the triangles that are in no block.
  void take(std::span<const std::uint32_t> blocks, const std::vector<SurfaceBlock>& results) {
    std::vector<Triangle> next;
    std::vector<WallSides> next_sides;
    std::vector<std::uint32_t> number(current_.size(), TriangleGrid::kNone);
    for (std::size_t t = 0; t < current_.size(); ++t) {
      if (blocks[t] != kNoBlock) continue;
      number[t] = static_cast<std::uint32_t>(next.size());
      next.push_back(current_[t]);
      if (walls_ != nullptr) next_sides.push_back(sides_[t]);
    }
    for (std::uint32_t& home : homes_) {
      if (home != TriangleGrid::kNone && blocks[home] == kNoBlock) home = number[home];
    }
    for (const SurfaceBlock& block : results) {
      const auto first = static_cast<std::uint32_t>(next.size());
      next.insert(next.end(), block.triangles.begin(), block.triangles.end());
      next_sides.insert(next_sides.end(), block.sides.begin(), block.sides.end());
      for (std::size_t n = 0; n < block.points.size(); ++n) {
        homes_[block.points[n]] = first + block.homes[n];
      }
    }
    current_ = std::move(next);
    sides_ = std::move(next_sides);
  }

  const SimplifyOptions& options_;
  const Context& context_;
  const Context quiet_;
  const Mesh& mesh_;
  const SeparatingSurface* walls_;
  const SurfaceView original_;  // what the error is measured from
  const Extent extent_;
  Cubes cubes_;
  std::optional<TriangleGrid> grid_;
  std::vector<Triangle> current_;
  std::vector<WallSides> sides_;  // of each triangle, where they are walls
  // The triangle near each measured point of the mesh. Empty if nothing is measured.
  std::vector<std::uint32_t> homes_;
  SimplificationEffect effect_;
};

}  // namespace

Proposal propose(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
                 const SeparatingSurface* walls) {
  Simplifier simplifier(options, context, mesh, walls);
  const SimplificationEffect effect = simplifier.run();
  return {effect, std::move(simplifier.triangles()), std::move(simplifier.sides())};
}

}  // namespace isomesh::mesh
