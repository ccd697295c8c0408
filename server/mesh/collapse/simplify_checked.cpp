#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "server/mesh/collapse/misses.h"
#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// The share of the error that a proposal may have where it is measured. With less, there are more
// triangles; with more, other points are beyond the error, and proposals are made again.
constexpr double kMeasuredShare = 0.55;
constexpr int kMostAttempts = 7;
constexpr double kFirstRadius = 0.5;  // of an edge: what is held around a place

// Cubes around places.
class Surroundings {
 public:
  Surroundings(const Extent& extent, double radius_mm)
      : low_(extent.low),
        side_(std::max({radius_mm, (extent.high[0] - extent.low[0]) / kMostCubes,
                        (extent.high[1] - extent.low[1]) / kMostCubes,
                        (extent.high[2] - extent.low[2]) / kMostCubes})) {}

  void add(const Point& place) {
    const Cube cube = cube_of(place);
    for (int n = 0; n < 27; ++n) {
      cubes_.insert(key({cube[0] + n % 3 - 1, cube[1] + n / 3 % 3 - 1, cube[2] + n / 9 - 1}));
    }
  }
  bool contain(const Point& place) const { return cubes_.contains(key(cube_of(place))); }

 private:
  static constexpr int kMostCubes = 1 << 18;
  using Cube = std::array<std::int64_t, 3>;

  Cube cube_of(const Point& place) const {
    Cube cube;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      cube[axis] = static_cast<std::int64_t>(std::floor((place[axis] - low_[axis]) / side_));
    }
    return cube;
  }
  static std::uint64_t key(const Cube& cube) {
    constexpr std::int64_t kBegin = 1 << 19;
    std::uint64_t key = 0;
    for (const std::int64_t number : cube) {
      key = key << 21 | static_cast<std::uint64_t>(number + kBegin);
    }
    return key;
  }

  Point low_;
  double side_;
  std::unordered_set<std::uint64_t> cubes_;
};

// Makes proposals until one is within the error at all its points, and those of the surface.
class Checker {
 public:
  Checker(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
          const SeparatingSurface* walls)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        walls_(walls),
        extent_(measure_extent(mesh, quiet_)),
        edge_mm_(
            std::sqrt(4 / std::sqrt(3.0) * extent_.area_mm2 / static_cast<double>(triangles()))),
        original_({options.before.empty() ? mesh.positions.span() : options.before,
                   mesh.triangles.span()},
                  walls == nullptr ? std::span<const WallSides>() : walls->sides.span(), quiet_),
        own_intersections_(extent_, edge_mm_),
        held_(mesh.positions.size(), 0) {
    if (!options.held.empty()) held_.assign(options.held.begin(), options.held.end());
    for (const IntersectingPair& pair : find_self_intersections(mesh, quiet_, kAll).places) {
      own_intersections_.add(pair.place);
    }
  }

  Proposal run() {
    SimplifyOptions options = options_;
    options.max_error_mm = kMeasuredShare * options_.max_error_mm;
    options.held = held_;
    for (int attempt = 0;; ++attempt) {
      const double done = 1 - std::pow(0.5, attempt);
      const Context part = context_.part(done, (1 + done) / 2);
      Proposal proposal = propose(options, part, mesh_, walls_);
      radius_mm_ = kFirstRadius * edge_mm_ * (attempt + 1);
      const bool is_within = holds_misses(proposal);
      const bool is_apart = holds_intersections(proposal);
      if ((is_within && is_apart) || attempt + 1 == kMostAttempts) {
        proposal.effect.is_within = is_within;
        return proposal;
      }
      hold();
    }
  }

 private:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  std::size_t triangles() const { return mesh_.triangles.size(); }

  // Remembers where the proposal is beyond the error. Returns true if that is nowhere.
  bool holds_misses(const Proposal& proposal) {
    const WallGrids proposed({mesh_.positions.span(), proposal.triangles}, proposal.sides, quiet_);
    const std::vector<Miss> lost = find_misses(original_, proposed, options_.max_error_mm, quiet_);
    const std::vector<Miss> added = find_misses(proposed, original_, options_.max_error_mm, quiet_);
    for (const Miss& miss : lost) {
      places_.push_back(miss.place);
      for (const std::uint32_t v : mesh_.triangles[miss.triangle]) held_[v] = 1;
    }
    for (const Miss& miss : added) places_.push_back(miss.place);
    return lost.empty() && added.empty();
  }

  // The same for where it newly intersects itself.
  bool holds_intersections(const Proposal& proposal) {
    const SurfaceView proposed(mesh_.positions.span(), proposal.triangles);
    bool are_all_old = true;
    for (const IntersectingPair& pair : find_self_intersections(proposed, quiet_, kAll).places) {
      if (own_intersections_.contain(pair.place)) continue;
      places_.push_back(pair.place);
      are_all_old = false;
    }
    return are_all_old;
  }

  void hold() {
    Surroundings around(extent_, radius_mm_);
    for (const Point& place : places_) around.add(place);
    places_.clear();
    for_each(quiet_, held_.size(), [&](std::size_t v) {
      if (around.contain(to_point(mesh_.positions[v]))) held_[v] = 1;
    });
  }

  const SimplifyOptions& options_;
  const Context& context_;
  const Context quiet_;
  const Mesh& mesh_;
  const SeparatingSurface* const walls_;
  const Extent extent_;
  const double edge_mm_;  // about the length of one
  const WallGrids original_;
  Surroundings own_intersections_;  // of the mesh
  std::vector<std::uint8_t> held_;
  std::vector<Point> places_;
  double radius_mm_ = 0;
};

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh,
                              SeparatingSurface* walls) {
  const std::uint64_t points = std::uint64_t{mesh.positions.size()} + mesh.triangles.size();
  if (points >= TriangleGrid::kNone) {
    throw Error(ErrorCode::kTooLarge, "the surface has " + std::to_string(points) +
                                          " vertices and triangles; more than 32 bits can number");
  }
  context.throw_if_stopped();
  if (mesh.triangles.size() == 0) return {};
  Proposal proposal = std::isfinite(options.max_error_mm)
                          ? Checker(options, context, mesh, walls).run()
                          : propose(options, context, mesh, walls);
  context.throw_if_stopped();
  replace_triangles(proposal.triangles, proposal.sides, mesh);
  if (walls != nullptr) {
    walls->sides.shrink(mesh.triangles.size());
    std::ranges::copy(proposal.sides, walls->sides.begin());
  }
  return proposal.effect;
}

}  // namespace

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context, Mesh& mesh) {
  return simplify(options, context, mesh, nullptr);
}

SimplificationEffect simplify(const SimplifyOptions& options, const Context& context,
                              SeparatingSurface& walls) {
  return simplify(options, context, walls.mesh, &walls);
}

}  // namespace isomesh::mesh
