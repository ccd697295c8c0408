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

// Blocks of triangles in the mesh's order; every step-th block is measured, from the first on.
struct MeasuredBlocks {
  std::size_t begin = 0;
  std::size_t end = 0;
  std::size_t step = 1;
};

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

}  // namespace isomesh::mesh
#endif

HWY_BEFORE_NAMESPACE();
namespace isomesh::mesh::HWY_NAMESPACE {
namespace {

using Lanes = std::array<float, kBlock>;

// Two sides of each triangle, from its first corner.
struct Sides {
  alignas(64) std::array<Lanes, 3> u;
  alignas(64) std::array<Lanes, 3> v;
};

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

// Four triangles at a time; the places after the last one are filled with its sides.
void load_sides(const Mesh& mesh, std::size_t begin, std::size_t count, Sides& sides) {
  for (std::size_t i = 0; i < count; i += 4) {
    std::array<Float4, 4> u;
    std::array<Float4, 4> v;
    for (std::size_t k = 0; k < 4; ++k) {
      const auto& [a, b, c] = mesh.triangles[begin + std::min(i + k, count - 1)];
      const Float4 corner = load(mesh.positions[a]);
      u[k] = load(mesh.positions[b]) - corner;
      v[k] = load(mesh.positions[c]) - corner;
    }
    store_transposed(u, i, sides.u);
    store_transposed(v, i, sides.v);
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

void measure_run(const Mesh& mesh, const MeasuredBlocks& blocks, ShapeSums& sums) {
  constexpr float kBins = Distribution::kBins;
  Sides sides = {};
  Values values;
  for (std::size_t block = blocks.begin; block < blocks.end; block += blocks.step) {
    const std::size_t begin = block * kBlock;
    const std::size_t count = std::min(kBlock, mesh.triangles.size() - begin);
    sums.triangles += count;
    load_sides(mesh, begin, count, sides);
    measure_block(sides, values);
    add_values(values.aspect_ratio, count, kBins, sums.aspect_ratio);
    add_values(values.smallest_angle_deg, count, kBins / 60, sums.smallest_angle_deg);
  }
}

}  // namespace

void measure_shapes_of(const Mesh& mesh, const MeasuredBlocks& blocks, ShapeSums& sums) {
  measure_run(mesh, blocks, sums);
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

}  // namespace

Shapes measure_shapes(const Mesh& mesh, const Context& context) {
  const std::size_t triangles = mesh.triangles.size();
  const std::size_t step =
      triangles <= kMostMeasuredTriangles ? 1 : chunks_of(triangles, kMostMeasuredTriangles / 2);
  const std::size_t blocks = chunks_of(triangles, kBlock);
  const std::size_t per_run = kMeasuredPerRun / kBlock * step;
  std::vector<ShapeSums> runs(chunks_of(blocks, per_run));
  const auto measure = HWY_DYNAMIC_DISPATCH(measure_shapes_of);
  const auto measure_run = [&](std::size_t begin, std::size_t end) {
    measure(mesh, {begin, end, step}, runs[begin / per_run]);
  };
  for_chunks(context, blocks, measure_run, per_run);
  return {summed(runs, &ShapeSums::aspect_ratio), summed(runs, &ShapeSums::smallest_angle_deg)};
}

}  // namespace isomesh::mesh
#endif
