#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <string>
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

// The share of the error that is used at first. With less, there are more triangles; with more,
// more triangles are beyond the error between the points where it is measured.
constexpr float kFirstShare = 0.9F;
constexpr float kTighter = 0.6F;  // what becomes of it around these
constexpr int kMostAttempts = 12;

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
        own_crossings_(own_crossings(), edge_mm_),
        shares_(mesh.positions.size(), kFirstShare) {
    if (!options.shares.empty()) shares_.assign(options.shares.begin(), options.shares.end());
    lost_.resize(mesh.triangles.size());
    std::iota(lost_.begin(), lost_.end(), 0U);
  }

  Proposal run() {
    SimplifyOptions options = options_;
    options.shares = shares_;
    const Original original = {original_, grids_};
    for (int attempt = 1;; ++attempt) {
      const Context part =
          context_.part(1 - std::pow(0.5, attempt - 1), 1 - std::pow(0.5, attempt));
      Proposal proposal = propose(options, part, mesh_, walls_, &original);
      look_at(proposal);
      if ((beyond_.empty() && crossings_.empty()) || attempt == kMostAttempts) {
        proposal.effect.is_within = beyond_.empty();
        return proposal;
      }
      tighten(attempt + 2 < kMostAttempts ? kTighter : 0);
    }
  }

 private:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  // The vertices of a triangle, the least one first, and its sides.
  using Key = std::array<std::uint32_t, 4>;

  static Key key_of(const WalledSurface& surface, std::uint32_t t) {
    Triangle triangle = surface.view.triangles[t];
    std::rotate(triangle.begin(), std::ranges::min_element(triangle), triangle.end());
    const WallSides sides = surface.sides_of(t);
    return {triangle[0], triangle[1], triangle[2], std::uint32_t{sides.front} << 16 | sides.back};
  }

  std::vector<IntersectingPair> crossings_of(const SurfaceView& surface) const {
    return find_self_intersections(surface, quiet_, kAll).places;
  }
  std::vector<Box> own_crossings() const {
    std::vector<Box> boxes;
    for (const IntersectingPair& pair : crossings_of(mesh_))
      boxes.push_back({pair.place, pair.place});
    return boxes;
  }

  // Remembers the places where the proposal is beyond the error, or newly intersects itself.
  void look_at(const Proposal& proposal) {
    const WalledSurface proposed = {{mesh_.positions.span(), proposal.triangles}, proposal.sides};
    beyond_.clear();
    crossings_.clear();
    const std::vector<std::uint32_t> fresh = find_fresh(proposed);
    suspects_.clear();
    look_for_crossings(proposed, fresh);
    const auto added = find_misses(proposed, fresh, grids_, options_.max_error_mm, quiet_);
    for (const Miss& miss : added) {
      add_beyond(miss, miss.near);
      suspects_.push_back(key_of(proposed, miss.triangle));
    }
    std::ranges::sort(suspects_);
    look_for_losses(proposed);
  }

  // `original`: around the original triangle that is at fault, or is nearest to it.
  void add_beyond(const Miss& miss, const Box& original) {
    beyond_.push_back({miss.place, miss.place});
    beyond_.push_back(original);
  }

  // The triangles that are not known to be within the error and apart from others. Also remembers
  // all, and boxes of what is new and of what is gone.
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
      const bool is_known = known != known_.end() && *known == key;
      if (is_known) {
        ++known;
      } else {
        change(key);
      }
      if (!is_known || std::ranges::binary_search(suspects_, key)) fresh.push_back(t);
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
    for (const IntersectingPair& pair : crossings_of(near.surface().view)) {
      const Box place = {pair.place, pair.place};
      if (own_crossings_.are_near(place)) continue;
      crossings_.push_back(place);
      for (const std::uint32_t t : {pair.first, pair.second}) {
        suspects_.push_back(key_of(near.surface(), t));
      }
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
      add_beyond(miss, box_of(original_.view, original_.view.triangles[miss.triangle]));
    }
  }

  // Leaves this much of the error around what is beyond it, and no vertex goes where others cross.
  void tighten(float share) {
    const MarkedCubes beyond(beyond_, edge_mm_ / 4);
    const MarkedCubes crossings(crossings_, std::max(edge_mm_, options_.max_error_mm) / 2);
    for_each(quiet_, shares_.size(), [&](std::size_t v) {
      const Point place = to_point(mesh_.positions[v]);
      const Box box = {place, place};
      if (beyond.are_near(box)) shares_[v] *= share;
      if (crossings.are_near(box)) shares_[v] = 0;
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
  const WallGrids grids_;            // of it
  const MarkedCubes own_crossings_;  // of the mesh with itself
  std::vector<float> shares_;        // of the error, near each vertex
  std::vector<Key> known_;           // of the triangles of the last proposal, in order
  std::vector<Key> suspects_;        // those beyond the error or across others, in order
  std::vector<Box> changed_;
  std::vector<std::uint32_t> lost_;  // original triangles beyond the error; in order
  std::vector<Box> beyond_;          // places beyond the error
  std::vector<Box> crossings_;       // where others cross each other newly
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
                          : propose(options, context, mesh, walls, nullptr);
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
