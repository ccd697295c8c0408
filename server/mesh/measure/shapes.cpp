// The code between HWY_BEFORE_NAMESPACE and HWY_AFTER_NAMESPACE is compiled once for each
// instruction set, as in slabs.cpp. Triangles are loaded in blocks of separate arrays, so the
// compiler vectorises the loops. The sums of a block have a fixed order, so results do not depend
// on the vector width.
#include "server/mesh/measure/shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <vector>

#include "server/mesh/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "server/mesh/measure/shapes.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef ISOMESH_SHAPES_ONCE_
#define ISOMESH_SHAPES_ONCE_
namespace isomesh::mesh {

constexpr std::size_t kBlock = 256;

// The measures of a run of triangles.
struct ShapeSums {
  std::size_t triangles = 0;

  // Sums of one quantity. Independent partial sums can be added at the same time.
  struct Sums {
    static constexpr std::size_t kParts = 8;

    std::array<double, kParts> sum = {};
    float min = INFINITY;
    std::array<std::array<std::uint32_t, Distribution::kBins>, 2> bins = {};
  };

  Sums aspect_ratio;
  Sums smallest_angle_deg;
};

using Lanes = std::array<float, kBlock>;

// Two sides of each triangle of a block, from its first corner.
struct Sides {
  alignas(64) std::array<Lanes, 3> u;
  alignas(64) std::array<Lanes, 3> v;
};

// A surface's triangles in their order, of which every step-th block is measured, from the first
// on.
struct MeasuredTriangles {
  std::uint64_t count = 0;  // of the surface
  std::size_t step = 1;     // in blocks
  std::uint64_t next = 0;   // the first triangle that has not been seen
  Sides sides = {};         // of those of its block that have been
};

}  // namespace isomesh::mesh
#endif

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {
namespace {

struct Values {
  alignas(64) Lanes aspect_ratio;
  alignas(64) Lanes smallest_angle_deg;
};

// Loading a position as four lanes reads four bytes of the next one; Buffer has such bytes after
// the last one.
using Float4 = float __attribute__((vector_size(16)));

HWY_INLINE Float4 load(const Vec3& position) {
  Float4 lanes;
  std::memcpy(&lanes, &position, sizeof lanes);
  return lanes;
}

// Transposes four vectors into four of each coordinate.
HWY_INLINE void store_transposed(const std::array<Float4, 4>& rows, std::size_t at,
                                 std::array<Lanes, 3>& out) {
  const Float4 low01 = __builtin_shufflevector(rows[0], rows[1], 0, 4, 1, 5);
  const Float4 low23 = __builtin_shufflevector(rows[2], rows[3], 0, 4, 1, 5);
  const Float4 high01 = __builtin_shufflevector(rows[0], rows[1], 2, 6, 3, 7);
  const Float4 high23 = __builtin_shufflevector(rows[2], rows[3], 2, 6, 3, 7);
  const std::array columns = {__builtin_shufflevector(low01, low23, 0, 1, 4, 5),
                              __builtin_shufflevector(low01, low23, 2, 3, 6, 7),
                              __builtin_shufflevector(high01, high23, 0, 1, 4, 5)};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::memcpy(&out[axis][at], &columns[axis], sizeof columns[axis]);
  }
}

// Of the triangles from `begin` on, to the places from `at` on. Four at a time; those behind the
// last are filled with its sides.
void load_sides(const Mesh& mesh, std::size_t begin, std::size_t count, std::size_t at,
                Sides& sides) {
  for (std::size_t i = 0; i < count; i += 4) {
    std::array<Float4, 4> u;
    std::array<Float4, 4> v;
    for (std::size_t k = 0; k < 4; ++k) {
      const auto& [a, b, c] = mesh.triangles[begin + std::min(i + k, count - 1)];
      const Float4 corner = load(mesh.positions[a]);
      u[k] = load(mesh.positions[b]) - corner;
      v[k] = load(mesh.positions[c]) - corner;
    }
    if (at + i + 4 <= kBlock) {
      store_transposed(u, at + i, sides.u);
      store_transposed(v, at + i, sides.v);
      continue;
    }
    for (std::size_t k = 0; at + i + k < kBlock; ++k) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        sides.u[axis][at + i + k] = u[k][static_cast<int>(axis)];
        sides.v[axis][at + i + k] = v[k][static_cast<int>(axis)];
      }
    }
  }
}

HWY_INLINE float least(float a, float b) { return a < b ? a : b; }
HWY_INLINE float most(float a, float b) { return a > b ? a : b; }

// The arcsine of 0 to 1, by the polynomial of Cephes' asinf.
HWY_INLINE float arc_sine(float sine) {
  const bool steep = sine > 0.5F;
  const float square = steep ? (1 - sine) * 0.5F : sine * sine;
  const float x = steep ? std::sqrt(square) : sine;
  const float p =
      ((((4.2163199048e-2F * square + 2.4181311049e-2F) * square + 4.5470025998e-2F) * square +
        7.4953002686e-2F) *
           square +
       1.6666752422e-1F) *
          square * x +
      x;
  return steep ? 1.57079633F - 2 * p : p;
}

// Lengths are relative to the longest side, so no product is too small for a float.
void measure_block(const Sides& sides, Values& values) {
  constexpr float kDegrees = 57.2957795F;
  for (std::size_t i = 0; i < kBlock; ++i) {
    float ux = sides.u[0][i];
    float uy = sides.u[1][i];
    float uz = sides.u[2][i];
    float vx = sides.v[0][i];
    float vy = sides.v[1][i];
    float vz = sides.v[2][i];
    const float wx = vx - ux;
    const float wy = vy - uy;
    const float wz = vz - uz;
    const float uu = ux * ux + uy * uy + uz * uz;
    const float vv = vx * vx + vy * vy + vz * vz;
    const float ww = wx * wx + wy * wy + wz * wz;
    const float longest = std::sqrt(most(most(uu, vv), ww));
    const float unit = longest > 0 ? 1 / longest : 0;
    ux *= unit;
    uy *= unit;
    uz *= unit;
    vx *= unit;
    vy *= unit;
    vz *= unit;
    const float nx = uy * vz - uz * vy;
    const float ny = uz * vx - ux * vz;
    const float nz = ux * vy - uy * vx;
    const float nn = nx * nx + ny * ny + nz * nz;  // four times the area, squared, over 4
    const float a = std::sqrt(uu) * unit;
    const float b = std::sqrt(vv) * unit;
    const float c = std::sqrt(ww) * unit;
    const float sum = a + b + c;
    const float product = a * b * c * sum;
    const float scale = product > 0 ? 1 / product : 0;
    // r = 2 A / sum and R = abc / (4 A) with A = |n| / 2. |n| = sin(angle) times the two sides at
    // the angle. The smallest angle lies between the two longer sides.
    values.aspect_ratio[i] = least(4 * nn * scale, 1);
    const float sine = least(std::sqrt(nn) * least(least(a, b), c) * sum * scale, 1);
    values.smallest_angle_deg[i] = least(arc_sine(sine) * kDegrees, 60);
  }
}

void add_values(const Lanes& values, std::size_t count, float per_bin, ShapeSums::Sums& sums) {
  constexpr std::size_t kParts = ShapeSums::Sums::kParts;
  std::size_t whole = count / kParts * kParts;
  for (std::size_t i = 0; i < whole; i += kParts) {
    for (std::size_t part = 0; part < kParts; ++part) sums.sum[part] += values[i + part];
  }
  for (std::size_t i = whole; i < count; ++i) sums.sum[i - whole] += values[i];
  for (std::size_t i = 0; i < count; ++i) sums.min = least(values[i], sums.min);
  alignas(64) std::array<std::int32_t, kBlock> bins;
  for (std::size_t i = 0; i < kBlock; ++i) bins[i] = static_cast<std::int32_t>(values[i] * per_bin);
  // Alternates between counters, because a count that was just written is slow to read.
  constexpr std::int32_t kLast = Distribution::kBins - 1;
  for (std::size_t i = 0; i < count; ++i) {
    ++sums.bins[i & 1][static_cast<std::size_t>(std::min(bins[i], kLast))];
  }
}

}  // namespace

// Adds the triangles [begin, end) of the mesh.
void measure_shapes_of(const Mesh& mesh, std::size_t begin, std::size_t end,
                       MeasuredTriangles& surface, ShapeSums& sums) {
  constexpr float kBins = Distribution::kBins;
  Values values;
  while (begin < end) {
    const std::uint64_t block = surface.next / kBlock;
    const std::size_t at = surface.next % kBlock;
    const std::size_t count = std::min(kBlock - at, end - begin);
    if (block % surface.step == 0) load_sides(mesh, begin, count, at, surface.sides);
    begin += count;
    surface.next += count;
    const bool is_complete = at + count == kBlock || surface.next == surface.count;
    if (block % surface.step != 0 || !is_complete) continue;
    sums.triangles += at + count;
    measure_block(surface.sides, values);
    add_values(values.aspect_ratio, at + count, kBins, sums.aspect_ratio);
    add_values(values.smallest_angle_deg, at + count, kBins / 60, sums.smallest_angle_deg);
  }
}

}  // namespace isomesh::mesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace isomesh::mesh {
namespace {

HWY_EXPORT(measure_shapes_of);

constexpr std::size_t kMeasuredPerRun = 32768;

Distribution summed(const std::vector<ShapeSums>& runs, ShapeSums::Sums ShapeSums::*quantity) {
  Distribution result;
  std::size_t triangles = 0;
  double sum = 0;
  float min = INFINITY;
  for (const ShapeSums& run : runs) {
    triangles += run.triangles;
    const ShapeSums::Sums& sums = run.*quantity;
    for (const double part : sums.sum) sum += part;
    min = std::min(min, sums.min);
    for (const auto& bins : sums.bins) {
      for (std::size_t bin = 0; bin < Distribution::kBins; ++bin)
        result.histogram[bin] += bins[bin];
    }
  }
  if (triangles == 0) return result;
  result.mean = sum / static_cast<double>(triangles);
  result.min = min;
  return result;
}

std::size_t step_of(std::uint64_t triangles) {
  return triangles <= kMostMeasuredTriangles ? 1 : chunks_of(triangles, kMostMeasuredTriangles / 2);
}

// The triangles whose measures are summed before they are added to those of others.
std::uint64_t triangles_per_run(std::uint64_t triangles) {
  return kMeasuredPerRun * step_of(triangles);
}

Shapes shapes_of(const std::vector<ShapeSums>& runs) {
  return {summed(runs, &ShapeSums::aspect_ratio), summed(runs, &ShapeSums::smallest_angle_deg)};
}

}  // namespace

Shapes measure_shapes(const Mesh& mesh, const Context& context) {
  const std::size_t triangles = mesh.triangles.size();
  const std::uint64_t per_run = triangles_per_run(triangles);
  std::vector<ShapeSums> runs(chunks_of(triangles, per_run));
  const auto measure = HWY_DYNAMIC_DISPATCH(measure_shapes_of);
  const auto measure_run = [&](std::size_t begin, std::size_t end) {
    MeasuredTriangles surface = {.count = triangles, .step = step_of(triangles), .next = begin};
    measure(mesh, begin, end, surface, runs[begin / per_run]);
  };
  for_chunks(context, triangles, measure_run, per_run);
  return shapes_of(runs);
}

struct ShapesSum::Sums {
  MeasuredTriangles surface;
  std::vector<ShapeSums> runs;
};

ShapesSum::ShapesSum(std::uint64_t triangles)
    : sums_(std::make_unique<Sums>(Sums{
          .surface = {.count = triangles, .step = step_of(triangles)},
          .runs = std::vector<ShapeSums>(chunks_of(triangles, triangles_per_run(triangles)))})) {}

ShapesSum::~ShapesSum() = default;

void ShapesSum::add(const Mesh& mesh, std::size_t begin, std::size_t end) {
  const std::uint64_t per_run = triangles_per_run(sums_->surface.count);
  while (begin < end) {
    const std::uint64_t next = sums_->surface.next;
    const std::size_t count = std::min<std::uint64_t>(end - begin, per_run - next % per_run);
    HWY_DYNAMIC_DISPATCH(measure_shapes_of)
    (mesh, begin, begin + count, sums_->surface, sums_->runs[next / per_run]);
    begin += count;
  }
}

Shapes ShapesSum::result() const { return shapes_of(sums_->runs); }

}  // namespace isomesh::mesh
#endif
