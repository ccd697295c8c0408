#include "server/mesh/stairs/stairs.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "server/mesh/labels/label_index.h"
#include "server/mesh/parallel.h"
#include "server/mesh/points.h"
#include "server/mesh/smooth/flat_triangles.h"
#include "server/mesh/smooth/layer_steps.h"
#include "server/mesh/stairs/missing_volume.h"
#include "server/mesh/stairs/mobility.h"
#include "server/mesh/stairs/unfold.h"
#include "server/mesh/stairs/volume_keeper.h"
#include "server/mesh/stairs/wall_shape.h"
#include "server/mesh/stairs/waves.h"

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

// Approximates exp(-time k), or (1 + time k) exp(-time k) if it is `flat`, where k is the
// eigenvalue of 1 - mean (0: constant, 2: the sign changes from each vertex to the next). Returns
// the coefficients c[j] of the Chebyshev polynomials T[j](1 - k) on [0, 2] (J. C. Mason, D. C.
// Handscomb, "Chebyshev Polynomials", 2003). Their sum is 1, so constants are preserved.
std::vector<float> series_of(int degree, double time, bool flat) {
  constexpr int kPoints = 400;  // of the quadrature, which is exact up to twice that degree
  std::vector<double> series;
  double sum = 0;
  for (int j = 0; j <= degree; ++j) {
    double coefficient = 0;
    for (int i = 0; i < kPoints; ++i) {
      const double angle = std::numbers::pi * (i + 0.5) / kPoints;
      const double k = 1 - std::cos(angle);
      coefficient += (flat ? 1 + time * k : 1) * std::exp(-time * k) * std::cos(j * angle);
    }
    series.push_back(coefficient * (j == 0 ? 1 : 2) / kPoints);
    sum += series.back();
  }
  std::vector<float> result;
  for (const double coefficient : series) result.push_back(static_cast<float>(coefficient / sum));
  return result;
}

// Moves those vertices, which are ascending, by the polynomial of the step that goes `shares[v]` of
// the way to the mean of a vertex's neighbours; all others stay. Throws Error kCancelled.
void filter(const std::vector<std::uint32_t>& vertices, const std::vector<float>& shares,
            std::span<const float> series, const Context& context, WallShape& shape) {
  Buffer<Lanes> first;
  first.resize_for_overwrite(shape.vertices());  // only of those that move
  std::array<Buffer<Lanes>, 2> values;           // T[j], by whether j is odd
  for (Buffer<Lanes>& each : values) {
    each.resize_for_overwrite(shape.vertices());
    for_chunks(context, shape.vertices(), [&](std::size_t begin, std::size_t end) {
      std::copy(shape.at.begin() + begin, shape.at.begin() + end, each.begin() + begin);
    });
  }
  std::vector<std::size_t> bounds;
  for (const std::size_t block : shape.blocks()) {
    bounds.push_back(std::ranges::lower_bound(vertices, block) - vertices.begin());
  }
  in_waves(
      context, bounds, series.size() - 1, [&](std::size_t j, std::size_t begin, std::size_t end) {
        const Buffer<Lanes>& now = values[(j - 1) % 2];
        Buffer<Lanes>& next = values[j % 2];
        for (std::size_t i = begin; i < end; ++i) {
          const std::size_t v = vertices[i];
          const Lanes moved = now[v] + shape.kept(v, shares[v] * (shape.mean(v, now) - now[v]));
          if (j == 1) first[v] = now[v];
          next[v] = j == 1 ? moved : 2.0F * moved - next[v];
          shape.at[v] += series[j] * (next[v] - first[v]);  // the sum of all is 1
        }
      });
}

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
      filter(round == 0 ? mobility_.moving : mobility_.walls, mobility_.moves, light, context_,
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
    return series_of(whole, time * ratio_, false);
  }

  // Along themselves, no coordinate by more than a step from the start; then the walls beside them
  // by two half steps.
  void smooth_curves() {
    const std::vector<std::uint32_t>& moving = mobility_.moving_curves;
    filter(moving, mobility_.moves, series_of(kCurveDegree, kCurveTime, true), context_, shape_);
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
LayerDisplacement take_over(const WallShape& shape, const LatticeToSpace& to_space, double most,
                            const Context& context, Mesh& mesh) {
  const std::array<Point, 3> steps = {to_space.step_x, to_space.step_y, to_space.step_z};
  constexpr std::size_t kRun = 8192;
  std::vector<LayerDisplacement> runs(chunks_of(mesh.positions.size(), kRun));
  const auto take_run = [&](std::size_t begin, std::size_t end) {
    LayerDisplacement& here = runs[begin / kRun];
    for (std::size_t v = begin; v < end; ++v) {
      const Lanes moved = shape.at[v] - shape.start()[v];
      Point way = {0, 0, 0};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto lane = static_cast<int>(axis);
        const double count = double{moved[lane]} / shape.spacing()[lane];
        for (std::size_t i = 0; i < 3; ++i) way[i] += count * steps[axis][i];
      }
      if (way == Point{0, 0, 0}) continue;
      const Vec3 start = mesh.positions[v];
      mesh.positions[v] = rounded_within(start, plus(to_point(start), way), most);
      here.add(start, mesh.positions[v]);
    }
  };
  for_chunks(context, mesh.positions.size(), take_run, kRun);
  LayerDisplacement all;
  for (const LayerDisplacement& run : runs) {
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
  Buffer<float> missing =
      missing_volume(PartsOf(lattice, surface.parts), options.scheme, surface, shape, quiet);
  report(0.3);
  Remover(std::move(missing), quiet, shape).run();
  report(0.9);
  const LayerDisplacement moved =
      take_over(shape, lattice.to_space, max_displacement_mm, quiet, surface.mesh);
  effect.after = open_flat(quiet, surface.mesh);
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
