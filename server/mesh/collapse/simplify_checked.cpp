#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string>
#include <unordered_set>
#include <utility>
#include <vector>

#include "server/mesh/collapse/misses.h"
#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/measure/marked_cubes.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/parallel.h"

namespace isomesh::mesh {
namespace {

// The share of the error that a proposal may have where it is measured. With less, there are more
// triangles; with more, other points are beyond the error, and proposals are made again.
constexpr double kMeasuredShare = 0.9;
constexpr int kMostAttempts = 8;
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

// Makes proposals until one is within the error at all its points, and those of the surface. After
// the first, it only looks at what has changed.
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
        edge_mm_(std::sqrt(4 / std::sqrt(3.0) * extent_.area_mm2 /
                           static_cast<double>(mesh.triangles.size()))),
        original_{{options.before.empty() ? mesh.positions.span() : options.before,
                   mesh.triangles.span()},
                  walls == nullptr ? std::span<const WallSides>() : walls->sides.span()},
        grids_(original_, quiet_),
        own_crossings_(extent_, edge_mm_),
        held_(mesh.positions.size(), 0) {
    if (!options.held.empty()) held_.assign(options.held.begin(), options.held.end());
    for (const IntersectingPair& pair : find_self_intersections(mesh, quiet_, kAll).places) {
      own_crossings_.add(pair.place);
    }
    lost_.resize(mesh.triangles.size());
    std::iota(lost_.begin(), lost_.end(), 0U);
  }

  Proposal run() {
    SimplifyOptions options = options_;
    options.max_error_mm = kMeasuredShare * options_.max_error_mm;
    options.held = held_;
    for (int attempt = 1;; ++attempt) {
      const Context part =
          context_.part(1 - std::pow(0.5, attempt - 1), 1 - std::pow(0.5, attempt));
      Proposal proposal = propose(options, part, mesh_, walls_);
      look_at(proposal);
      if (places_.empty() || attempt == kMostAttempts) {
        proposal.effect.is_within = is_within_;
        return proposal;
      }
      hold(kFirstRadius * edge_mm_ * attempt);
    }
  }

 private:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  // The vertices of a triangle, the least one first, and its sides.
  using Key = std::array<std::uint32_t, 4>;

  static Key key_of(const WalledSurface& surface, std::uint32_t t) {
    Triangle triangle = surface.view.triangles[t];
    std::ranges::rotate(triangle, std::ranges::min_element(triangle));
    const WallSides sides = surface.sides_of(t);
    return {triangle[0], triangle[1], triangle[2], std::uint32_t{sides.front} << 16 | sides.back};
  }

  // Remembers the places where the proposal is beyond the error, or newly intersects itself.
  void look_at(const Proposal& proposal) {
    const WalledSurface proposed = {{mesh_.positions.span(), proposal.triangles}, proposal.sides};
    const std::vector<std::uint32_t> fresh = find_fresh(proposed);
    look_for_crossings(proposed, fresh);
    const auto added = find_misses(proposed, fresh, grids_, options_.max_error_mm, quiet_);
    for (const Miss& miss : added) {
      places_.push_back(miss.place);
      known_.erase(std::ranges::lower_bound(known_, key_of(proposed, miss.triangle)));
    }
    look_for_losses(proposed);
    is_within_ = added.empty() && lost_.empty();
  }

  // The triangles that are not known to be within the error. Also remembers them, and boxes of
  // those and of what is gone.
  std::vector<std::uint32_t> find_fresh(const WalledSurface& proposed) {
    std::vector<std::pair<Key, std::uint32_t>> all(proposed.view.triangles.size());
    for (std::uint32_t t = 0; t < all.size(); ++t) all[t] = {key_of(proposed, t), t};
    std::ranges::sort(all);
    changed_.clear();
    const auto change = [&](const Key& key) {
      changed_.push_back(box_of(proposed.view, {key[0], key[1], key[2]}));
    };
    std::vector<std::uint32_t> fresh;
    auto known = known_.begin();
    for (const auto& [key, t] : all) {
      for (; known != known_.end() && *known < key; ++known) change(*known);
      if (known != known_.end() && *known == key) {
        ++known;
        continue;
      }
      change(key);
      fresh.push_back(t);
    }
    for (; known != known_.end(); ++known) change(*known);
    known_.clear();
    for (const auto& [key, t] : all) known_.push_back(key);
    std::ranges::sort(fresh);
    return fresh;
  }

  void look_for_crossings(const WalledSurface& proposed, std::span<const std::uint32_t> fresh) {
    std::vector<Box> boxes;
    for (const std::uint32_t t : fresh) {
      boxes.push_back(box_of(proposed.view, proposed.view.triangles[t]));
    }
    const Part near(proposed, MarkedCubes(boxes, 0));
    for (const IntersectingPair& pair :
         find_self_intersections(near.surface().view, quiet_, kAll).places) {
      if (!own_crossings_.contain(pair.place)) places_.push_back(pair.place);
    }
  }

  // Looks at the original triangles that were beyond the error, and at those near what has changed.
  void look_for_losses(const WalledSurface& proposed) {
    const MarkedCubes near_changed(changed_, options_.max_error_mm);
    std::vector<std::uint32_t> which;
    std::vector<Box> boxes;
    auto lost = lost_.begin();
    for (std::uint32_t t = 0; t < original_.view.triangles.size(); ++t) {
      const Box box = box_of(original_.view, original_.view.triangles[t]);
      const bool was_lost = lost != lost_.end() && *lost == t;
      if (was_lost) ++lost;
      if (!was_lost && !near_changed.are_near(box)) continue;
      which.push_back(t);
      boxes.push_back(box);
    }
    const Part near(proposed, MarkedCubes(boxes, options_.max_error_mm));
    const WallGrids grids(near.surface(), quiet_);
    lost_.clear();
    for (const Miss& miss : find_misses(original_, which, grids, options_.max_error_mm, quiet_)) {
      lost_.push_back(miss.triangle);
      places_.push_back(miss.place);
      for (const std::uint32_t v : mesh_.triangles[miss.triangle]) held_[v] = 1;
    }
  }

  void hold(double radius_mm) {
    Surroundings around(extent_, radius_mm);
    for (const Point& place : places_) around.add(place);
    places_.clear();
    for_each(quiet_, held_.size(), [&](std::size_t v) {
      if (around.contain(to_point(mesh_.positions[v]))) held_[v] = 1;
    });
  }

  // The triangles of a surface in marked cubes.
  class Part {
   public:
    Part(const WalledSurface& whole, const MarkedCubes& cubes) : positions_(whole.view.positions) {
      for (std::size_t t = 0; t < whole.view.triangles.size(); ++t) {
        const Triangle& triangle = whole.view.triangles[t];
        if (!cubes.are_near(box_of(whole.view, triangle))) continue;
        triangles_.push_back(triangle);
        if (!whole.sides.empty()) sides_.push_back(whole.sides[t]);
      }
    }
    WalledSurface surface() const { return {{positions_, triangles_}, sides_}; }

   private:
    std::span<const Vec3> positions_;
    std::vector<Triangle> triangles_;
    std::vector<WallSides> sides_;
  };

  const SimplifyOptions& options_;
  const Context& context_;
  const Context quiet_;
  const Mesh& mesh_;
  const SeparatingSurface* const walls_;
  const Extent extent_;
  const double edge_mm_;  // about the length of one
  const WalledSurface original_;
  const WallGrids grids_;       // of it
  Surroundings own_crossings_;  // of the mesh with itself
  std::vector<std::uint8_t> held_;
  std::vector<Key> known_;  // of proposed triangles that need no other look; in order
  std::vector<Box> changed_;
  std::vector<std::uint32_t> lost_;  // original triangles beyond the error; in order
  std::vector<Point> places_;        // of what is wrong
  bool is_within_ = false;
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
