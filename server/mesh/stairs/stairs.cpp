#include "server/mesh/stairs/stairs.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/mesh/labels/label_index.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/stairs/filter.h"
#include "server/mesh/stairs/missing_volume.h"
#include "server/mesh/stairs/mobility.h"
#include "server/mesh/stairs/unfold.h"
#include "server/mesh/stairs/volume_keeper.h"
#include "server/mesh/stairs/wall_shape.h"

namespace isomesh::mesh {
namespace {

// Several rounds, so that small structures never shrink much before they get their volume back. By
// trial (`isomesh-bench labels`): one smoothing round less, or with less than three restores at the
// end, sheets lose 4 % of their volume and labels of the JHU atlas 1 %; one more gains nothing.
constexpr int kSmoothings = 2;
constexpr int kRestores = 3;
// Diffusion times and polynomial degrees for an even spacing. series() multiplies times by the
// spacing's ratio and degrees by its square root. The values for curves are not scaled.
constexpr double kSmoothTime = 3.5;
constexpr double kSmoothDegree = 4;
constexpr double kSpreadTime = 12;
constexpr double kSpreadDegree = 7;
constexpr double kCurveTime = 30;
constexpr int kCurveDegree = 10;
// More uneven than this a lattice leaves nothing to be evened out.
constexpr double kMostRatio = 5;

class Remover {
 public:
  Remover(Buffer<float> missing, const Context& context, WallShape& shape)
      : shape_(shape),
        context_{context.stop, nullptr},
        mobility_(find_mobility(shape, context_)),
        ratio_(std::min(kMostRatio, double{shape.largest_spacing()} / shape.smallest_spacing())),
        spread_(series(kSpreadDegree, kSpreadTime)),
        keeper_(shape, mobility_, std::move(missing), spread_, context_) {}

  void run() {
    const std::vector<float> light = series(kSmoothDegree, kSmoothTime);
    for (int round = 0; round < kSmoothings; ++round) {
      // Curves along with the walls only once: this shrinks those that are round.
      filter(round == 0 ? mobility_.moving : moving_walls(), mobility_.moves, light, context_,
             shape_);
      keeper_.restore(shape_);
    }
    if (!mobility_.curves.empty()) smooth_curves();
    for (int round = 0; round < kRestores; ++round) {
      keeper_.restore(shape_);
      unfold(context_, shape_);
    }
  }

 private:
  std::vector<float> series(double degree, double time) const {
    const auto whole = static_cast<int>(std::lround(degree * std::sqrt(ratio_)));
    return diffusion_series(whole, time * ratio_);
  }

  std::vector<std::uint32_t> moving_walls() const {
    std::vector<std::uint32_t> walls;
    std::ranges::copy_if(mobility_.moving, std::back_inserter(walls),
                         [&](std::uint32_t v) { return !shape_.is_curve(v); });
    return walls;
  }

  // Along themselves, no coordinate by more than a step from the start; then the walls beside them
  // by two half steps.
  void smooth_curves() {
    std::vector<std::uint32_t> moving;
    std::ranges::copy_if(mobility_.curves, std::back_inserter(moving),
                         [&](std::uint32_t v) { return mobility_.moves[v] > 0; });
    filter(moving, mobility_.moves, flat_series(kCurveDegree, kCurveTime), context_, shape_);
    for (const std::uint32_t v : moving) shape_.hold(v, 1);
    constexpr std::array<float, 3> kHalfSteps = {0.25F, 0.5F, 0.25F};  // of the mean, squared
    filter(mobility_.beside, mobility_.moves, kHalfSteps, context_, shape_);
    keeper_.hold_curves();
  }

  WallShape& shape_;
  const Context context_;
  const Mobility mobility_;
  const double ratio_;
  const std::vector<float> spread_;
  VolumeKeeper keeper_;
};

// Moves the mesh's vertices as the shape's were; those that did not move keep their bits.
struct Displacements {
  double sum = 0;
  double largest = 0;
};

Displacements take_over(const WallShape& shape, const LatticeToSpace& to_space, double most,
                        const Context& context, Mesh& mesh) {
  const std::array<Point, 3> steps = {to_space.step_x, to_space.step_y, to_space.step_z};
  constexpr std::size_t kRun = 8192;
  std::vector<Displacements> runs(chunks_of(mesh.positions.size(), kRun));
  const auto take_run = [&](std::size_t begin, std::size_t end) {
    Displacements& here = runs[begin / kRun];
    for (std::size_t v = begin; v < end; ++v) {
      const Lanes moved = shape.at[v] - shape.start()[v];
      Point way = {0, 0, 0};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto lane = static_cast<int>(axis);
        const double count = double{moved[lane]} / shape.spacing()[lane];
        for (std::size_t i = 0; i < 3; ++i) way[i] += count * steps[axis][i];
      }
      const double size = std::sqrt(dot(way, way));
      if (size == 0) continue;
      // A little less, so that rounding does not lead beyond.
      constexpr double kBelow = 1 - 1e-6;
      const double share = size > most ? most / size * kBelow : 1;
      for (std::size_t i = 0; i < 3; ++i) {
        mesh.positions[v][i] = static_cast<float>(mesh.positions[v][i] + way[i] * share);
      }
      here.sum += size * share;
      here.largest = std::max(here.largest, size * share);
    }
  };
  for_chunks(context, mesh.positions.size(), take_run, kRun);
  Displacements all;
  for (const Displacements& run : runs) {
    all.sum += run.sum;
    all.largest = std::max(all.largest, run.largest);
  }
  return all;
}

}  // namespace

template <class T>
SmoothingEffect remove_stairs(const Lattice<T>& lattice, const SeparateOptions& options,
                              double max_displacement_mm, const Context& context,
                              SeparatingSurface& surface) {
  const Context quiet = {context.stop, nullptr};
  const auto report = [&](double share) {
    if (context.progress) context.progress(share);
  };
  SmoothingEffect effect;
  effect.before = effect.after = measure_extent(surface.mesh, quiet);
  if (surface.mesh.positions.size() == 0) return effect;
  WallShape shape(surface, lattice.dims, lattice.to_space, options.close, quiet);
  report(0.2);
  Buffer<float> missing = missing_volume(lattice, options.scheme, surface, shape, quiet);
  report(0.3);
  Remover(std::move(missing), quiet, shape).run();
  report(0.9);
  const Displacements moved =
      take_over(shape, lattice.to_space, max_displacement_mm, quiet, surface.mesh);
  effect.after = measure_extent(surface.mesh, quiet);
  effect.mean_displacement_mm = moved.sum / static_cast<double>(surface.mesh.positions.size());
  effect.max_displacement_mm = moved.largest;
  report(1);
  return effect;
}

std::uint64_t stairs_memory(const SurfaceSize& size) {
  // Places: as extracted, now, and three in a filter; shares and areas in single precision.
  constexpr std::uint64_t kBytesPerVertex = 5 * sizeof(Lanes) + 16 * sizeof(float);
  constexpr std::uint64_t kBytesPerFan = 2 * sizeof(Lanes) + 10 * sizeof(float);
  return WallFans::bytes(size.vertices, size.triangles) + NeighborLists::bytes(size.vertices) +
         size.vertices * (kBytesPerVertex + kBytesPerFan * 3 / 2);
}

#define ISOMESH_INSTANTIATE(T)                                                              \
  template SmoothingEffect remove_stairs(const Lattice<T>&, const SeparateOptions&, double, \
                                         const Context&, SeparatingSurface&);
ISOMESH_FOR_EACH_LABEL_TYPE(ISOMESH_INSTANTIATE)
#undef ISOMESH_INSTANTIATE

}  // namespace isomesh::mesh
