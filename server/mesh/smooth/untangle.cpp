#include "server/mesh/smooth/untangle.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <iterator>
#include <utility>
#include <vector>

#include "server/mesh/measure/join_equal.h"
#include "server/mesh/measure/marked_cubes.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/parallel.h"
#include "server/mesh/smooth/flat_triangles.h"
#include "server/mesh/smooth/layer_steps.h"

namespace isomesh::mesh {
namespace {

// The last one leads all the way to the extracted position.
constexpr std::uint8_t kMostMoves = 5;

class Untangler {
 public:
  Untangler(const UntangleOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        extracted_(options.extracted),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        moves_(mesh.positions.size(), 0),
        was_moved_(mesh.positions.size(), 0),
        is_left_(mesh.triangles.size(), false) {}

  UntangleEffect run(const Context& context) {
    UntangleEffect effect;
    double done = 0;
    const auto progress = [&] {
      done = (1 + done) / 2;
      if (context.progress) context.progress(done);
    };
    Extent bounds;
    bool is_first = true;
    do {
      bounds = measure_extent(mesh_, quiet_);
      if (options_.rounding) rounding_ = options_.rounding(mesh_);
      is_left_.assign(is_left_.size(), false);
      std::vector<std::uint32_t> found = crossing(nullptr);
      if (is_first) effect.pairs = count_pairs(found);
      is_first = false;
      judge(found);
      found = {};
      progress();
      while (move_back()) {
        look_again();
        progress();
      }
    } while (options_.rounding && has_other_bounds(bounds));
    effect.left = count_pairs(numbers_that([&](std::size_t t) { return bool{is_left_[t]}; }));
    effect.vertices = static_cast<std::uint64_t>(
        std::ranges::count_if(moves_, [](std::uint8_t moves) { return moves > 0; }));
    // Corners that are all back may be in line, as they were extracted.
    if (effect.vertices > 0) open_flat(quiet_, mesh_);
    add_displacements(effect);
    return effect;
  }

 private:
  bool has_other_bounds(const Extent& before) const {
    const Extent now = measure_extent(mesh_, quiet_);
    return now.low != before.low || now.high != before.high;
  }

  // These triangles, or all, as arrays: in the positions, and in the rounded ones.
  std::vector<Triangle> copy_of(const std::vector<std::uint32_t>* numbers) const {
    if (numbers == nullptr) return {mesh_.triangles.begin(), mesh_.triangles.end()};
    std::vector<Triangle> some;
    some.reserve(numbers->size());
    for (const std::uint32_t t : *numbers) some.push_back(mesh_.triangles[t]);
    return some;
  }
  std::vector<Triangle> rounded_copy_of(const std::vector<std::uint32_t>* numbers) {
    std::vector<Triangle> some = copy_of(numbers);
    rounded_.resize(mesh_.positions.size());
    for (const Triangle& triangle : some) {
      for (const std::uint32_t v : triangle) rounded_[v] = rounding_.rounded(mesh_.positions[v]);
    }
    join_equal(rounded_, some);
    return some;
  }

  // Those of these triangles, or of all, that intersect another one of them, ascending: in the
  // positions, in the rounded ones, or in both.
  std::vector<std::uint32_t> crossing(const std::vector<std::uint32_t>* numbers) {
    std::vector<std::uint32_t> found;
    if (options_.is_exact && numbers == nullptr) {
      found = find_intersecting_triangles(mesh_, quiet_);
    } else if (options_.is_exact) {
      const std::vector<Triangle> some = copy_of(numbers);
      found = find_intersecting_triangles({positions(), some}, quiet_);
    }
    if (options_.rounding) {
      const std::vector<Triangle> some = rounded_copy_of(numbers);
      const auto rounded = find_intersecting_triangles({rounded_, some}, quiet_);
      std::vector<std::uint32_t> both;
      both.reserve(std::min(some.size(), found.size() + rounded.size()));
      std::ranges::set_union(found, rounded, std::back_inserter(both));
      found = std::move(both);
    }
    if (numbers != nullptr) {
      for (std::uint32_t& t : found) t = (*numbers)[t];
    }
    return found;
  }

  // The pairs among these triangles that intersect, in some positions.
  std::uint64_t count_pairs(const std::vector<std::uint32_t>& numbers) {
    if (numbers.empty()) return 0;
    const std::vector<Triangle> some = copy_of(&numbers);
    const SurfaceView exact = {positions(), some};
    std::uint64_t pairs = 0;
    if (options_.is_exact) pairs += find_self_intersections(exact, quiet_).pairs;
    if (!options_.rounding) return pairs;
    const std::vector<Triangle> joined = rounded_copy_of(&numbers);
    const auto is_other = [&](std::uint32_t first, std::uint32_t second) {
      return !options_.is_exact || !intersect_each_other(exact, first, second);
    };
    return pairs + count_intersecting_pairs({rounded_, joined}, quiet_, is_other);
  }

  std::span<const Vec3> positions() const { return mesh_.positions.span(); }

  bool is_home(std::uint32_t vertex) const { return mesh_.positions[vertex] == extracted_[vertex]; }
  bool is_home(const Triangle& triangle) const {
    return std::ranges::all_of(triangle, [&](std::uint32_t vertex) { return is_home(vertex); });
  }

  // Triangles that stand where they were extracted are left as they are; all others move.
  void judge(const std::vector<std::uint32_t>& crossing) {
    for (const std::uint32_t t : crossing) {
      if (is_home(mesh_.triangles[t])) {
        is_left_[t] = true;
      } else {
        at_fault_.push_back(t);
      }
    }
  }

  // Moves the vertices of the triangles at fault, and forgets these. Returns false if none moved.
  bool move_back() {
    for (const std::uint32_t vertex : moved_) was_moved_[vertex] = 0;
    moved_.clear();
    for (const std::uint32_t triangle : at_fault_) {
      for (const std::uint32_t vertex : mesh_.triangles[triangle]) {
        if (!is_home(vertex) && std::exchange(was_moved_[vertex], 1) == 0) moved_.push_back(vertex);
      }
    }
    at_fault_.clear();
    for (const std::uint32_t vertex : moved_) {
      Vec3& position = mesh_.positions[vertex];
      const Vec3& home = extracted_[vertex];
      const float rest = ++moves_[vertex] < kMostMoves ? 0.5F : 0.0F;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        position[axis] = home[axis] + rest * (position[axis] - home[axis]);
      }
    }
    return !moved_.empty();
  }

  // The numbers of the triangles for which is_one(number) is true, ascending.
  template <class IsOne>
  std::vector<std::uint32_t> numbers_that(IsOne is_one) const {
    const std::size_t count = mesh_.triangles.size();
    std::vector<std::vector<std::uint32_t>> chunks(chunks_of(count));
    for_chunks(quiet_, count, [&](std::size_t begin, std::size_t end) {
      std::vector<std::uint32_t>& chunk = chunks[begin / kChunk];
      for (std::size_t t = begin; t < end; ++t) {
        if (is_one(t)) chunk.push_back(static_cast<std::uint32_t>(t));
      }
    });
    std::size_t all_of_them = 0;
    for (const auto& chunk : chunks) all_of_them += chunk.size();
    std::vector<std::uint32_t> all;
    all.reserve(all_of_them);
    for (const auto& chunk : chunks) all.insert(all.end(), chunk.begin(), chunk.end());
    return all;
  }

  // The triangles whose box is near that of one with a vertex that was moved. Those of the latter
  // that lost their area are at fault.
  std::vector<std::uint32_t> around_moved() {
    const SurfaceView surface = mesh_;
    const std::vector<std::uint32_t> changed = numbers_that([&](std::size_t t) {
      return std::ranges::any_of(mesh_.triangles[t],
                                 [&](std::uint32_t v) { return was_moved_[v] != 0; });
    });
    std::vector<Box> boxes;
    boxes.reserve(changed.size());
    for (const std::uint32_t t : changed) {
      const Triangle& triangle = mesh_.triangles[t];
      boxes.push_back(box_of(surface, triangle));
      if (has_no_area(mesh_, triangle) && !is_home(triangle)) at_fault_.push_back(t);
    }
    const MarkedCubes cubes(boxes, 2 * rounding_.most_mm);
    return numbers_that(
        [&](std::size_t t) { return cubes.are_near(box_of(surface, mesh_.triangles[t])); });
  }

  // Finds what is at fault among the triangles around what was moved.
  void look_again() {
    const std::vector<std::uint32_t> around = around_moved();
    judge(crossing(&around));
  }

  void add_displacements(UntangleEffect& effect) const {
    std::vector<LayerDisplacement> chunks(chunks_of(extracted_.size()));
    for_chunks(quiet_, extracted_.size(), [&](std::size_t begin, std::size_t end) {
      for (std::size_t v = begin; v < end; ++v) {
        chunks[begin / kChunk].add(extracted_[v], mesh_.positions[v]);
      }
    });
    for (const auto& [sum, largest] : chunks) {
      effect.mean_displacement_mm += sum / static_cast<double>(extracted_.size());
      effect.max_displacement_mm = std::max(effect.max_displacement_mm, largest);
    }
  }

  const UntangleOptions& options_;
  const std::span<const Vec3> extracted_;
  const Context quiet_;
  Mesh& mesh_;
  std::vector<std::uint8_t> moves_;      // of each vertex, so far
  std::vector<std::uint8_t> was_moved_;  // 1 for each of these
  std::vector<std::uint32_t> moved_;
  std::vector<std::uint32_t> at_fault_;  // triangles
  std::vector<bool> is_left_;            // triangles that intersect where they were extracted
  Rounding rounding_;
  std::vector<Vec3> rounded_;  // of the vertices that were looked at last
};

}  // namespace

UntangleEffect untangle(const UntangleOptions& options, const Context& context, Mesh& mesh) {
  return Untangler(options, context, mesh).run(context);
}

std::uint64_t untangling_memory(const SurfaceSize& size) {
  constexpr std::uint64_t kGrid = 100;  // triangle_grid.h
  // The triangles around what was moved, as numbers and as arrays; what is at fault among them.
  constexpr std::uint64_t kLists = sizeof(Triangle) + 5 * sizeof(std::uint32_t);
  // With rounding: rounded positions, and join_equal.h.
  constexpr std::uint64_t kOfVertex =
      2 * sizeof(std::uint8_t) + sizeof(std::uint32_t) + sizeof(Vec3) + 9;
  constexpr std::uint64_t kCubes = std::uint64_t{1} << 24;  // marked_cubes.h; before the grid
  const std::uint64_t looking = size.triangles * (kGrid + kLists);
  const std::uint64_t marking = size.triangles * (sizeof(Box) + kLists) + kCubes;
  return std::max(looking, marking) + size.vertices * kOfVertex;
}

}  // namespace isomesh::mesh
