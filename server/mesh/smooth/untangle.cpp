#include "server/mesh/smooth/untangle.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <vector>

#include "server/mesh/measure/join_equal.h"
#include "server/mesh/measure/marked_cubes.h"
#include "server/mesh/measure/measure.h"
#include "server/mesh/measure/self_intersections.h"
#include "server/mesh/measure/surface_view.h"
#include "server/mesh/parallel.h"
#include "server/mesh/smooth/layer_steps.h"

namespace isomesh::mesh {
namespace {

// The last one leads all the way to the extracted position.
constexpr std::uint8_t kMostMoves = 5;

template <class T>
void sort_and_unite(std::vector<T>& values) {
  std::ranges::sort(values);
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

class Untangler {
 public:
  Untangler(const UntangleOptions& options, const Context& context, Mesh& mesh)
      : options_(options),
        extracted_(options.extracted),
        quiet_{context.stop, nullptr},
        mesh_(mesh),
        moves_(mesh.positions.size(), 0),
        was_moved_(mesh.positions.size(), 0) {}

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
      left_.clear();
      const std::vector<Pair> found = crossings(nullptr);
      if (is_first) effect.pairs = found.size();
      is_first = false;
      judge(found);
      progress();
      while (move_back()) {
        look_again();
        progress();
      }
    } while (options_.rounding && has_other_bounds(bounds));
    sort_and_unite(left_);
    effect.left = left_.size();
    effect.vertices = static_cast<std::uint64_t>(
        std::ranges::count_if(moves_, [](std::uint8_t moves) { return moves > 0; }));
    add_displacements(effect);
    return effect;
  }

 private:
  static constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();

  // Numbers of triangles.
  using Pair = std::array<std::uint32_t, 2>;

  bool has_other_bounds(const Extent& before) const {
    const Extent now = measure_extent(mesh_, quiet_);
    return now.low != before.low || now.high != before.high;
  }

  // The pairs of all triangles, or of these: in the positions, in the rounded ones, or in both.
  std::vector<Pair> crossings(const std::vector<std::uint32_t>* numbers) {
    std::vector<Triangle> some;
    if (numbers != nullptr) {
      for (const std::uint32_t t : *numbers) some.push_back(mesh_.triangles[t]);
    } else if (options_.rounding) {
      some.assign(mesh_.triangles.begin(), mesh_.triangles.end());
    }
    const bool is_all = numbers == nullptr && !options_.rounding;
    std::vector<Pair> pairs;
    const auto add = [&](const SurfaceView& surface) {
      const SelfIntersections found = find_self_intersections(surface, quiet_, kAll);
      for (const auto& [first, second, place] : found.places) {
        pairs.push_back(numbers == nullptr ? Pair{first, second}
                                           : Pair{(*numbers)[first], (*numbers)[second]});
      }
    };
    if (options_.is_exact) add(is_all ? SurfaceView(mesh_) : SurfaceView(positions(), some));
    if (options_.rounding) {
      rounded_.resize(mesh_.positions.size());
      for (const Triangle& triangle : some) {
        for (const std::uint32_t v : triangle) rounded_[v] = rounding_.rounded(mesh_.positions[v]);
      }
      join_equal(rounded_, some);
      add({rounded_, some});
    }
    sort_and_unite(pairs);
    return pairs;
  }

  std::span<const Vec3> positions() const { return mesh_.positions.span(); }

  bool is_home(std::uint32_t vertex) const { return mesh_.positions[vertex] == extracted_[vertex]; }
  bool is_home(const Triangle& triangle) const {
    return std::ranges::all_of(triangle, [&](std::uint32_t vertex) { return is_home(vertex); });
  }

  void judge(const std::vector<Pair>& pairs) {
    for (const Pair& pair : pairs) {
      if (is_home(mesh_.triangles[pair[0]]) && is_home(mesh_.triangles[pair[1]])) {
        left_.push_back(pair);
      } else {
        at_fault_.insert(at_fault_.end(), pair.begin(), pair.end());
      }
    }
  }

  // Moves the vertices of the triangles at fault, and forgets these. Returns false if none moved.
  bool move_back() {
    for (const std::uint32_t vertex : moved_) was_moved_[vertex] = 0;
    moved_.clear();
    for (const std::uint32_t triangle : at_fault_) {
      for (const std::uint32_t vertex : mesh_.triangles[triangle]) {
        if (!is_home(vertex)) moved_.push_back(vertex);
      }
    }
    at_fault_.clear();
    sort_and_unite(moved_);
    for (const std::uint32_t vertex : moved_) {
      was_moved_[vertex] = 1;
      Vec3& position = mesh_.positions[vertex];
      const Vec3& home = extracted_[vertex];
      const float rest = ++moves_[vertex] < kMostMoves ? 0.5F : 0.0F;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        position[axis] = home[axis] + rest * (position[axis] - home[axis]);
      }
    }
    return !moved_.empty();
  }

  // The numbers of the triangles for which is_one(triangle) is true, ascending.
  template <class IsOne>
  std::vector<std::uint32_t> triangles_that(IsOne is_one) const {
    const std::size_t count = mesh_.triangles.size();
    std::vector<std::vector<std::uint32_t>> chunks(chunks_of(count));
    for_chunks(quiet_, count, [&](std::size_t begin, std::size_t end) {
      std::vector<std::uint32_t>& chunk = chunks[begin / kChunk];
      for (std::size_t t = begin; t < end; ++t) {
        if (is_one(mesh_.triangles[t])) chunk.push_back(static_cast<std::uint32_t>(t));
      }
    });
    std::vector<std::uint32_t> all;
    for (const auto& chunk : chunks) all.insert(all.end(), chunk.begin(), chunk.end());
    return all;
  }

  // Finds what is at fault among the triangles around what was moved.
  void look_again() {
    const SurfaceView surface = mesh_;
    const std::vector<std::uint32_t> changed = triangles_that([&](const Triangle& triangle) {
      return std::ranges::any_of(triangle, [&](std::uint32_t v) { return was_moved_[v] != 0; });
    });
    std::vector<Box> boxes;
    for (const std::uint32_t t : changed) {
      const Triangle& triangle = mesh_.triangles[t];
      boxes.push_back(box_of(surface, triangle));
      if (has_no_area(mesh_, triangle) && !is_home(triangle)) at_fault_.push_back(t);
    }
    const MarkedCubes cubes(boxes, 2 * rounding_.most_mm);
    const std::vector<std::uint32_t> around = triangles_that(
        [&](const Triangle& triangle) { return cubes.are_near(box_of(surface, triangle)); });
    judge(crossings(&around));
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
  std::vector<Pair> left_;
  Rounding rounding_;
  std::vector<Vec3> rounded_;  // of the vertices that were looked at last
};

}  // namespace

UntangleEffect untangle(const UntangleOptions& options, const Context& context, Mesh& mesh) {
  return Untangler(options, context, mesh).run(context);
}

std::uint64_t untangling_memory(const SurfaceSize& size) {
  constexpr std::uint64_t kGrid = 100;  // triangle_grid.h
  // With rounding: the triangles of joined vertices, rounded positions, and join_equal.h.
  constexpr std::uint64_t kOfVertex = 2 * sizeof(std::uint8_t) + sizeof(Vec3) + 9;
  return size.triangles * (kGrid + sizeof(Triangle)) + size.vertices * kOfVertex;
}

}  // namespace isomesh::mesh
