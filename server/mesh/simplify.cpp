#include "server/mesh/simplify.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "server/mesh/measure.h"
#include "server/mesh/parallel.h"
#include "server/mesh/simplify_block.h"
#include "server/mesh/simplify_layers.h"

namespace isomesh::mesh {
namespace {

// Larger blocks have fewer seams, smaller ones stay in the cache and are sooner made again.
constexpr double kTrianglesPerBlock = 6'000;
// Of a cube's side, how near the seams of one round the next one looks.
constexpr double kSeamWidth = 0.08;
constexpr int kMostRounds = 6;
constexpr int kMostRepairs = 12;  // of seams; the second half leaves blocks as they were
constexpr std::uint32_t kNoBlock = ~std::uint32_t{0};
constexpr double kMostCubesPerAxis = 64;

// Cuts space into cubes. Those of the odd rounds are moved by half a side along each axis.
class Cubes {
 public:
  Cubes(const Extent& extent, std::size_t triangles) : low_(extent.low) {
    if (!std::isfinite(extent.area_mm2)) {
      throw Error(ErrorCode::kUnusableVolume, "a position of the mesh is not a finite number");
    }
    const double area_per_triangle = extent.area_mm2 / static_cast<double>(triangles);
    side_ = std::sqrt(kTrianglesPerBlock * area_per_triangle);
    double longest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      longest = std::max(longest, extent.high[axis] - extent.low[axis]);
    }
    side_ = std::max(side_, longest / kMostCubesPerAxis);
    if (!(side_ > 0)) side_ = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      count_[axis] = static_cast<std::uint32_t>((extent.high[axis] - extent.low[axis]) / side_) + 2;
    }
  }

  std::uint32_t count() const { return count_[0] * count_[1] * count_[2]; }

  std::uint32_t at(const Point& point, int round) const {
    const double shift = round % 2 == 1 ? 0.5 : 0;
    std::uint32_t cube = 0;
    for (std::size_t axis = 3; axis-- > 0;) {
      const double place = (point[axis] - low_[axis]) / side_ + shift;
      const auto at = static_cast<std::uint32_t>(std::clamp(place, 0.0, count_[axis] - 1.0));
      cube = cube * count_[axis] + at;
    }
    return cube;
  }

  // Whether a face between cubes of the round before is near.
  bool is_near_seam(const Point& point, int round) const {
    const double shift = round % 2 == 1 ? 0 : 0.5;
    return std::ranges::any_of(std::array<std::size_t, 3>{0, 1, 2}, [&](std::size_t axis) {
      const double place = (point[axis] - low_[axis]) / side_ + shift;
      return std::abs(place - std::round(place)) < kSeamWidth;
    });
  }

 private:
  Point low_;
  double side_ = 1;
  std::array<std::uint32_t, 3> count_ = {1, 1, 1};
};

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
  Simplifier(const SimplifyOptions& options, const Context& context, const Mesh& mesh)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        cubes_(measure_extent(mesh, quiet_), mesh.triangles.size()),
        current_(mesh.triangles.begin(), mesh.triangles.end()) {
    if (!std::isfinite(options.max_error_mm)) return;
    grid_.emplace(mesh, quiet_);
    const std::size_t vertices = mesh.positions.size();
    homes_.assign(vertices + current_.size(), TriangleGrid::kNone);
    for (std::size_t t = current_.size(); t-- > 0;) {
      for (const std::uint32_t vertex : current_[t]) homes_[vertex] = static_cast<std::uint32_t>(t);
      homes_[vertices + t] = static_cast<std::uint32_t>(t);
    }
  }

  SimplificationEffect run() {
    effect_.triangles_before = current_.size();
    for (int round = 0; round < kMostRounds; ++round) {
      const std::size_t before = current_.size();
      if (is_enough()) break;
      run_round(round);
      if (round == 0) continue;
      // The second round is for the seams of the first; more are for a number of triangles, as long
      // as they come nearer to it.
      if (options_.triangles == 0) break;
      if (10 * (before - current_.size()) < before - options_.triangles) break;
    }
    effect_.triangles_after = current_.size();
    effect_.reached_triangles = options_.triangles == 0 || is_enough();
    return effect_;
  }

  std::vector<Triangle>& triangles() { return current_; }

 private:
  bool is_enough() const { return options_.triangles > 0 && current_.size() <= options_.triangles; }

  std::uint32_t block_of(std::size_t triangle, int round) const {
    const SurfaceView view(mesh_.positions.span(), {&current_[triangle], 1});
    const Point centre = measured_point(view, mesh_.positions.size());
    const bool is_left_out =
        round > 0 && options_.triangles == 0 && !cubes_.is_near_seam(centre, round);
    return is_left_out ? kNoBlock : cubes_.at(centre, round);
  }

  void run_round(int round) {
    std::vector<std::uint32_t> blocks(current_.size());
    constexpr std::size_t kPerTask = 1 << 15;
    parallel_for(quiet_, (blocks.size() + kPerTask - 1) / kPerTask, [&](std::size_t task) {
      const std::size_t end = std::min(blocks.size(), (task + 1) * kPerTask);
      for (std::size_t t = task * kPerTask; t < end; ++t) blocks[t] = block_of(t, round);
    });
    const Groups triangles(cubes_.count(), current_.size(),
                           [&](std::size_t t) { return blocks[t]; });
    const Groups points(cubes_.count(), homes_.size(), [&](std::size_t n) {
      return homes_[n] == TriangleGrid::kNone ? kNoBlock : blocks[homes_[n]];
    });
    std::vector<std::uint32_t> place(current_.size());  // of a triangle within its block
    for (std::size_t b = 0; b < cubes_.count(); ++b) {
      const auto members = triangles.of(b);
      for (std::size_t n = 0; n < members.size(); ++n) {
        place[members[n]] = static_cast<std::uint32_t>(n);
      }
    }
    const auto block_from = [&](std::size_t b) {
      SurfaceBlock block;
      for (const std::uint32_t t : triangles.of(b)) block.triangles.push_back(current_[t]);
      for (const std::uint32_t point : points.of(b)) {
        block.points.push_back(point);
        block.homes.push_back(place[homes_[point]]);
      }
      return block;
    };
    std::vector<SurfaceBlock> results(cubes_.count());
    simplify_blocks(round, block_from, results);
    settle_seams(block_from, results);
    take(blocks, results);
  }

  BlockGoal goal() const {
    const double share = options_.triangles == 0
                             ? 0
                             : static_cast<double>(options_.triangles) /
                                   static_cast<double>(std::max<std::size_t>(1, current_.size()));
    return {mesh_, grid_ ? &*grid_ : nullptr, options_.max_error_mm, share};
  }

  template <class BlockFrom>
  void simplify_blocks(int round, const BlockFrom& block_from, std::vector<SurfaceBlock>& results) {
    std::atomic<std::uint64_t> blocks = 0;
    std::atomic<std::uint64_t> repeated = 0;
    std::atomic<std::uint64_t> taken_back = 0;
    Context context = quiet_;
    if (context_.progress) {
      context.progress = [&, round](double share) {
        context_.progress(std::min(1.0, round == 0 ? share * 0.7 : 0.7 + share * 0.3));
      };
    }
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

  struct BlockEdge {
    SeamEdge edge;
    std::uint32_t block = 0;
  };

  // Edges between seam vertices that have more than two triangles although none had before: two
  // blocks have each made the same edge. Those of the blocks that made them.
  std::vector<BlockEdge> crowded_edges(const std::vector<SurfaceBlock>& results) const {
    std::vector<std::vector<SeamEdge>> of_blocks(results.size());
    parallel_for(quiet_, results.size(),
                 [&](std::size_t b) { of_blocks[b] = seam_edges(results[b].triangles); });
    std::vector<BlockEdge> edges;
    for (std::uint32_t b = 0; b < of_blocks.size(); ++b) {
      for (const SeamEdge& edge : of_blocks[b]) edges.push_back({edge, b});
    }
    std::ranges::stable_sort(edges, {}, [](const BlockEdge& e) {
      return std::uint64_t{e.edge.low} << 32 | e.edge.high;
    });
    std::vector<BlockEdge> crowded;
    for (std::size_t begin = 0; begin < edges.size();) {
      std::size_t end = begin;
      std::uint32_t all = 0;
      for (; end < edges.size() && edges[end].edge.low == edges[begin].edge.low &&
             edges[end].edge.high == edges[begin].edge.high;
           ++end) {
        all += edges[end].edge.triangles;
      }
      const bool is_wall =
          mesh_.is_on_line(edges[begin].edge.low) && mesh_.is_on_line(edges[begin].edge.high);
      for (; begin < end; ++begin) {
        if (all > 2 && !is_wall && edges[begin].edge.triangles > 1) crowded.push_back(edges[begin]);
      }
    }
    return crowded;
  }

  // Simplifies the blocks again that made such edges, without them; in the end leaves them as they
  // were, which had none.
  template <class BlockFrom>
  void settle_seams(const BlockFrom& block_from, std::vector<SurfaceBlock>& results) {
    std::vector<std::vector<std::uint32_t>> held(results.size());
    for (int attempt = 0; attempt < kMostRepairs; ++attempt) {
      const std::vector<BlockEdge> crowded = crowded_edges(results);
      if (crowded.empty()) return;
      std::vector<std::uint32_t> blocks;
      for (const auto& [edge, block] : crowded) {
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
    // What was there before the first round is not for us to mend.
  }

  // Puts what the blocks have become behind what is in none.
  void take(std::span<const std::uint32_t> blocks, const std::vector<SurfaceBlock>& results) {
    std::vector<Triangle> next;
    std::vector<std::uint32_t> number(current_.size(), TriangleGrid::kNone);
    for (std::size_t t = 0; t < current_.size(); ++t) {
      if (blocks[t] != kNoBlock) continue;
      number[t] = static_cast<std::uint32_t>(next.size());
      next.push_back(current_[t]);
    }
    for (std::uint32_t& home : homes_) {
      if (home != TriangleGrid::kNone && blocks[home] == kNoBlock) home = number[home];
    }
    for (const SurfaceBlock& block : results) {
      const auto first = static_cast<std::uint32_t>(next.size());
      next.insert(next.end(), block.triangles.begin(), block.triangles.end());
      for (std::size_t n = 0; n < block.points.size(); ++n) {
        homes_[block.points[n]] = first + block.homes[n];
      }
    }
    current_ = std::move(next);
  }

  const SimplifyOptions& options_;
  const Context& context_;
  const Context quiet_;
  const Mesh& mesh_;
  const Cubes cubes_;
  std::optional<TriangleGrid> grid_;
  std::vector<Triangle> current_;
  // Of each measured point of the mesh the triangle that is near it; none where nothing is
  // measured.
  std::vector<std::uint32_t> homes_;
  SimplificationEffect effect_;
};

}  // namespace

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh) {
  const std::uint64_t points = std::uint64_t{mesh.positions.size()} + mesh.triangles.size();
  if (points >= TriangleGrid::kNone) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(points) +
                                          " vertices and triangles; 32 bits cannot number them");
  }
  context.throw_if_stopped();
  if (mesh.triangles.size() == 0) return {};
  Simplifier simplifier(options, context, mesh);
  const SimplificationEffect effect = simplifier.run();
  context.throw_if_stopped();
  replace_triangles(simplifier.triangles(), mesh);
  return effect;
}

}  // namespace isomesh::mesh
