#include "server/jobs/making/stage_times.h"

#include <algorithm>
#include <cmath>

#include "proto/stages.h"
#include "server/codec/formats.h"
#include "server/jobs/making/error_budget.h"
#include "server/mesh/smooth/methods.h"

namespace isomesh::jobs {
namespace {

using mesh::SurfaceSize;

// Milliseconds.
constexpr double kMillisecondsPerJob = 1;
constexpr double kLoadPerSample = 1.3e-6;
constexpr double kExtractPerSample = 1.0e-6;
constexpr double kExtractPerTriangle = 1.6e-5;
constexpr double kMeasurePerTriangle = 3.0e-5;
constexpr double kUntanglePerTriangle = 1.2e-3;
constexpr double kSimplifyPerTriangle = 5.0e-4;
constexpr double kSimplifyWithinPerTriangle = 4.0e-3;
constexpr double kLevelsPerTriangle = 7.5e-4;
constexpr double kGridPerTriangle = 3.0e-4;  // of both surfaces, and of what intersects in one
constexpr double kDistancePerPoint = 5.0e-4;
constexpr double kThicknessPerTriangle = 1.0e-3;

double as_double(std::uint64_t count) { return static_cast<double>(count); }

double extract_ms(const SurfaceSize& surface, std::uint64_t samples) {
  return kExtractPerSample * as_double(samples) +
         kExtractPerTriangle * as_double(surface.triangles);
}

double smooth_ms(const SurfaceSize& surface, const MeshParameters& parameters) {
  if (parameters.passes == 0) return 0;
  const mesh::SmoothingMethod& method = mesh::method_of(parameters.smoothing);
  return as_double(surface.triangles) *
         (method.ms_per_triangle + method.ms_per_triangle_and_pass * parameters.passes);
}

double untangle_ms(const SurfaceSize& surface, const MeshParameters& parameters) {
  return parameters.untangle ? kUntanglePerTriangle * as_double(surface.triangles) : 0;
}

double simplify_ms(const SurfaceSize& surface, const MeshParameters& parameters) {
  if (!parameters.max_error_mm && !parameters.triangles) return 0;
  return as_double(surface.triangles) *
         (parameters.max_error_mm ? kSimplifyWithinPerTriangle : kSimplifyPerTriangle);
}

// How much longer it takes to find what is near if the spacing is uneven. The cells of
// mesh/measure/triangle_grid.h are crowded then, and have trees.
double uneven_factor(const VolumeSize& volume) {
  constexpr double kPerDoubling = 0.2;
  constexpr double kMost = 1.4;
  const double ratio = volume.largest_spacing_mm / volume.smallest_spacing_mm;
  return 1 + std::min(kMost, kPerDoubling * std::log2(std::max(1.0, ratio)));
}

double certify_ms(const SurfaceSize& surface, const SurfaceSize& written, const VolumeSize& volume,
                  const MeshParameters& parameters) {
  const auto points = [&](const SurfaceSize& size) {
    const double all = as_double(size.vertices + size.triangles);
    return parameters.max_error_mm ? std::min(all, as_double(kMostPointsBesideAProof)) : all;
  };
  const auto measured = static_cast<double>(measured_formats(parameters).size());
  return measured * uneven_factor(volume) *
         (kGridPerTriangle * as_double(surface.triangles + written.triangles) +
          kDistancePerPoint * (points(surface) + points(written)));
}

double thickness_ms(const SurfaceSize& written, const VolumeSize& volume) {
  return uneven_factor(volume) * kThicknessPerTriangle * as_double(written.triangles);
}

// Formats are written in parallel, so the slowest counts fully and the others by half.
double encode_ms(const SurfaceSize& surface, const MeshParameters& parameters) {
  double slowest = kMeasurePerTriangle;
  double sum = kMeasurePerTriangle;
  for (const MeshFormat format : files_of(parameters)) {
    const double each = codec::describe(format).milliseconds_per_triangle;
    slowest = std::max(slowest, each);
    sum += each;
  }
  const double levels = parameters.lods.size() > 1 ? kLevelsPerTriangle : 0;
  return as_double(surface.triangles) * (slowest + (sum - slowest) / 2 + levels);
}

// A guess of a surface's size before it is extracted.
SurfaceSize typical_surface(double samples) {
  // A surface grows with the square of the volume's length, and the samples with the cube. The
  // factor is 135 for a noisy head and 20 for a smooth body of CT.
  constexpr double kTypical = 50;
  const double triangles = kTypical * std::pow(samples, 2.0 / 3);
  return {static_cast<std::uint64_t>(triangles), static_cast<std::uint64_t>(triangles / 2)};
}

}  // namespace

VolumeSize VolumeSize::of(const Volume& volume) {
  const auto [smallest, largest] = std::ranges::minmax(volume.geometry.spacing);
  return {volume.sample_count(), smallest, largest};
}

Timing stage_times(const SurfaceSize& extracted, const SurfaceSize& written,
                   const VolumeSize& volume, const MeshParameters& parameters,
                   const Measures& measures) {
  Timing times;
  times.load = kMillisecondsPerJob + kLoadPerSample * as_double(volume.samples);
  times.extract = extract_ms(extracted, volume.samples);
  times.smooth = smooth_ms(extracted, parameters);
  times.untangle = untangle_ms(extracted, parameters);
  times.simplify = simplify_ms(extracted, parameters);
  times.encode = encode_ms(written, parameters);
  if (measures.certify) times.certify = certify_ms(extracted, written, volume, parameters);
  if (measures.min_thickness_mm) times.thickness = thickness_ms(written, volume);
  return times;
}

double share_within(double error_mm, double spacing_mm) {
  // A fit to heads with 1 mm voxels.
  constexpr double kHalf = 0.06;  // the error that leaves half of the triangles, in spacings
  constexpr double kSteepness = 1.16;
  return 1 / (1 + std::pow(error_mm / spacing_mm / kHalf, kSteepness));
}

SurfaceSize simplified_surface(const SurfaceSize& extracted, const MeshParameters& parameters,
                               double spacing_mm, double correction) {
  double triangles = as_double(extracted.triangles);
  if (parameters.max_error_mm) {
    triangles *= std::min(1.0, correction * share_within(*parameters.max_error_mm, spacing_mm));
  }
  if (parameters.triangles) triangles = std::min<double>(triangles, *parameters.triangles);
  SurfaceSize result = extracted;
  result.triangles = static_cast<std::uint64_t>(std::llround(triangles));
  result.vertices = std::min(extracted.vertices, result.triangles / 2);
  return result;
}

Timing expected_times(const Volume& volume, const MeshParameters& parameters,
                      const Measures& measures) {
  VolumeSize size = VolumeSize::of(volume);
  auto samples = as_double(size.samples);
  if (parameters.crop) {
    double part = 1;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto& [low, high] = *parameters.crop;
      part *= std::abs(high[axis] - low[axis]) / volume.geometry.spacing[axis];
    }
    samples = std::min(samples, part);
  }
  size.samples = static_cast<std::uint64_t>(samples);
  const SurfaceSize extracted = typical_surface(samples);
  const SurfaceSize written = simplified_surface(extracted, parameters, size.smallest_spacing_mm);
  return stage_times(extracted, written, size, parameters, measures);
}

double expected_ms(const Volume& volume, const JobParameters& parameters) {
  const Timing times = expected_times(volume, parameters, parameters);
  double sum = 0;
  for (const StageRow& row : kStages) {
    if (row.elapsed != nullptr) sum += times.*row.elapsed;
  }
  return sum;
}

}  // namespace isomesh::jobs
