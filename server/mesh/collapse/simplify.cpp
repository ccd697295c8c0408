#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "server/mesh/collapse/kept_points.h"
#include "server/mesh/collapse/patches.h"
#include "server/mesh/collapse/proposal.h"
#include "server/mesh/collapse/simplify_layers.h"
#include "server/mesh/collapse/simplify_lines.h"
#include "server/mesh/collapse/simplify_patch.h"
#include "server/mesh/measure/measure.h"

namespace isomesh::mesh {
namespace {

using collapse::CubeCut;
using collapse::Patch;
using collapse::Vecd;
using collapse::Vecf;

// The share of the error that measured points may use. With less, there are more triangles; with
// more, more of them are beyond the error between the points.
constexpr double kMeasuredShare = 0.95;
constexpr int kMostRounds = 12;
// The share of the triangles that a round leaves at least. Seams stay in a round, so triangles
// beside them would become much smaller than the others.
constexpr double kLeastShare = 0.25;
// The share of the target that blocks leave for the whole surface, where the least of all edges
// goes first.
constexpr double kForTheWhole = 1.5;
constexpr double kMostCubesPerAxis = 64;
constexpr CubeCut kWhole = {std::numeric_limits<float>::infinity(), false, false};

// The length of edges of a triangle of the mean area, or anything.
double unit_of(const Extent& extent, std::size_t triangles) {
  if (!std::isfinite(extent.area_mm2)) {
    throw Error(ErrorCode::kUnusableVolume, "a position of the mesh is not a finite number");
  }
  return extent.area_mm2 > 0 ? std::sqrt(extent.area_mm2 / static_cast<double>(triangles)) : 1;
}

class Simplifier {
 public:
  // `walls` are whose mesh it is, if any.
  Simplifier(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
             const SeparatingSurface* walls, const Original& original)
      : options_(options),
        context_(context),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        sides_(walls == nullptr ? std::span<const WallSides>() : walls->sides.span()),
        extent_(measure_extent(mesh, quiet_)),
        triangles_(mesh.triangles.begin(), mesh.triangles.end()),
        numbers_(triangles_.size()),
        history_(mesh.positions.size()),
        around_{quiet_,  mesh,      unit_of(extent_, triangles_.size()),
                nullptr, &history_, options.max_error_mm},
        patches_(
            triangles_, numbers_, mesh.positions.size(),
            [this](std::uint32_t v) { return place_of(v); }, scaled(extent_.high)) {
    std::iota(numbers_.begin(), numbers_.end(), 0U);
    if (original.grids == nullptr) return;
    points_.emplace(original.surface, *original.grids, kMeasuredShare * options.max_error_mm);
    around_.points = &*points_;
  }

  Proposal run() {
    effect_.triangles_before = triangles_.size();
    if (options_.triangles == 0) {
      reduce_within_error();
    } else if (!is_enough()) {
      reduce_to_number();
    }
    effect_.triangles_after = triangles_.size();
    return {effect_, std::move(triangles_), std::move(numbers_), std::move(history_)};
  }

 private:
  bool is_enough() const { return triangles_.size() <= options_.triangles; }

  void reduce_within_error() {
    const float side_of_all = side();  // which seams must be found by again
    for (const bool is_second : {false, true}) reduce_lines({side_of_all, is_second, false}, 0);
    for (const bool is_second : {false, true}) {
      const Context context = is_second ? context_.part(0.7, 1) : context_.part(0, 0.7);
      reduce({side_of_all, is_second, is_second}, context, 0);
    }
  }

  void reduce_to_number() {
    const auto target = static_cast<double>(options_.triangles);
    double done = 0;
    for (int round = 0; round < kMostRounds; ++round) {
      const auto before = static_cast<double>(triangles_.size());
      const double aim = std::max(kForTheWhole * target, kLeastShare * before);
      if (before <= aim) break;
      const bool is_shifted = round % 2 == 1;
      reduce_lines({side(), is_shifted, false}, aim / before);
      // Cubes grow with the triangles, so that in the end few seams are left to keep them.
      const double begin = std::exchange(done, done + 0.7 * (1 - done));
      reduce({side(), is_shifted, false}, context_.part(begin, done), aim / before);
      if (10 * (before - static_cast<double>(triangles_.size())) < before - aim) break;
    }
    // Junction curves keep walls from becoming fewer triangles, and walls keep curves.
    double most = 1;
    for (std::size_t before = 0; before != triangles_.size() && !is_enough(); most = kLeastShare) {
      before = triangles_.size();
      reduce_lines(kWhole, std::min(most, target / static_cast<double>(before)));
      reduce_whole(options_.triangles);
      if (sides_.empty()) break;
    }
    effect_.reached_triangles = is_enough();
    effect_.is_least = !effect_.reached_triangles && is_least();
  }

  bool is_least() {
    if (!points_) return true;
    // Any further collapse, whatever the error, is enough to tell that it was not the topology.
    const std::vector<Triangle> triangles = triangles_;
    const std::vector<std::uint32_t> numbers = numbers_;
    around_.points = nullptr;
    around_.history = nullptr;
    around_.max_error_mm = std::numeric_limits<double>::infinity();
    reduce_lines(kWhole, 0);
    reduce_whole(triangles.size() - 1);
    const bool is_least = triangles_.size() == triangles.size();
    triangles_ = triangles;
    numbers_ = numbers;
    return is_least;
  }

  // In the unit of `around_`.
  Vecf place_of(std::uint32_t vertex) const { return scaled(to_point(mesh_.positions[vertex])); }

  Vecf scaled(const Point& place) const {
    const auto [x, y, z] = minus(place, extent_.low);
    return narrow(Vecd{x, y, z} * (1 / around_.unit_mm));
  }

  float side() const {
    const auto [x, y, z] = scaled(extent_.high);
    const double area = extent_.area_mm2 / std::pow(around_.unit_mm, 2);
    const double even =
        std::sqrt(collapse::kBlockTriangles * area / static_cast<double>(triangles_.size()));
    const double least = double{std::max({x, y, z})} / kMostCubesPerAxis;
    return static_cast<float>(std::max({even, least, 1e-30}));
  }

  // Simplifies the junction curves within each cube.
  void reduce_lines(const CubeCut& cut, double share) {
    if (sides_.empty()) return;
    const std::vector<std::uint32_t> degrees = count_triangles();
    begin_pass();
    patches_.collapse(cut, quiet_, [&](Patch& patch) {
      set_stays(degrees, patch);
      simplify_lines(around_, sides_, share, patch);
    });
  }

  void reduce(const CubeCut& cut, const Context& context, double share) {
    const std::vector<std::uint32_t> degrees = count_triangles();
    begin_pass();
    patches_.collapse(cut, context, [&](Patch& patch) {
      set_stays(degrees, patch);
      hold_lines(patch);
      const double least = share * static_cast<double>(patch.triangles.size());
      simplify_patch(around_, static_cast<std::size_t>(least), false, patch);
    });
  }

  void reduce_whole(std::size_t least) {
    begin_pass();
    patches_.collapse(kWhole, quiet_, [&](Patch& patch) {
      hold_lines(patch);
      simplify_patch(around_, least, around_.points == nullptr, patch);
    });
  }

  // Each collapse takes a triangle away at least, so its step is more than those of earlier passes.
  void begin_pass() {
    around_.step = static_cast<std::uint32_t>(effect_.triangles_before - triangles_.size());
  }

  // How many triangles each vertex has.
  std::vector<std::uint32_t> count_triangles() const {
    std::vector<std::uint32_t> degrees(mesh_.positions.size(), 0);
    for (const Triangle& triangle : triangles_) {
      for (const std::uint32_t vertex : triangle) ++degrees[vertex];
    }
    return degrees;
  }

  // Vertices that have triangles elsewhere stay.
  void set_stays(std::span<const std::uint32_t> degrees, Patch& patch) const {
    std::vector<std::uint32_t> found(patch.names.size(), 0);
    for (const Triangle& triangle : patch.triangles) {
      for (const std::uint32_t vertex : triangle) ++found[vertex];
    }
    for (std::size_t v = 0; v < found.size(); ++v) {
      if (found[v] != degrees[patch.names[v]]) patch.stays[v] |= collapse::kIsElsewhere;
    }
  }

  void hold_lines(Patch& patch) const {
    for (std::size_t v = 0; v < patch.names.size(); ++v) {
      if (mesh_.is_on_line(patch.names[v])) patch.stays[v] |= collapse::kStays;
    }
  }

  const SimplifyOptions& options_;
  const Context& context_;
  const Context quiet_;
  const Mesh& mesh_;
  const std::span<const WallSides> sides_;  // of the mesh's triangles, where they are walls
  const Extent extent_;
  std::vector<Triangle> triangles_;
  std::vector<std::uint32_t> numbers_;  // of each triangle: one of the mesh that became it
  collapse::History history_;
  std::optional<collapse::KeptPoints> points_;
  collapse::SimplifySurroundings around_;
  collapse::Patches patches_;
  SimplificationEffect effect_;
};

}  // namespace

Proposal propose(const SimplifyOptions& options, const Context& context, const Mesh& mesh,
                 const SeparatingSurface* walls, const Original& original) {
  return Simplifier(options, context, mesh, walls, original).run();
}

}  // namespace isomesh::mesh
