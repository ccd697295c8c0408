#include "server/mesh/measure/cavities.h"

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/measure/measure.h"
#include "server/mesh/topology/topology.h"
#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/support/heap.h"
#include "tests/support/kernels.h"
#include "tests/support/mesh_checks.h"
#include "tests/support/shapes.h"

namespace isomesh::mesh {
namespace {

using test::Point;

// Balls within each other around one place: solid, hollow, solid, hollow.
test::Field onion(const Point& centre) {
  return [centre](const Point& point) {
    const double radius = 13.2 - test::sphere(centre, 13.2)(point);
    return std::max(std::min(13.2 - radius, radius - 9.1), std::min(6.3 - radius, radius - 3.2));
  };
}

Mesh extracted(const test::SampleVolume<float>& volume, bool close) {
  return test::extracted(volume, {0, Scheme::kSix, Interpolation::kLinear, close});
}

TEST(Cavities, LeaveTheOutermostShell) {
  Mesh mesh = extracted(test::sample<float>(onion({15, 15, 15}), {31, 31, 31}), false);
  Mesh ball = extracted(test::sample<float>(test::sphere({15, 15, 15}, 13.2), {31, 31, 31}), false);
  ASSERT_EQ(measure_topology(mesh, {}).components, 4U);
  const std::uint64_t before = mesh.triangles.size();
  const Dropped dropped = fill_cavities({}, mesh);
  EXPECT_EQ(dropped.components, 3U);
  EXPECT_EQ(dropped.triangles, before - mesh.triangles.size());
  EXPECT_EQ(measure_topology(mesh, {}).components, 1U);
  EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, measure_extent(ball, {}).volume_mm3, 1e-3);
}

// The wall of a hollow that the border of the volume cuts open is no cavity's.
TEST(Cavities, LeaveWhatIsOpen) {
  const auto volume = test::sample<float>(onion({15, 15, 0}), {31, 31, 31});
  Mesh open = extracted(volume, false);
  EXPECT_EQ(fill_cavities({}, open).components, 0U);
  EXPECT_EQ(measure_topology(open, {}).components, 4U);
  // Closed, it is two shells, each with an opening to nowhere.
  Mesh closed = extracted(volume, true);
  const std::uint64_t components = measure_topology(closed, {}).components;
  EXPECT_EQ(fill_cavities({}, closed).components, 0U);
  EXPECT_EQ(measure_topology(closed, {}).components, components);
}

// One flag per sample: true if lattice edges between outside samples connect it to the border.
// Computed by brute force, without a mesh.
std::vector<bool> open_air(const test::SampleVolume<float>& volume) {
  const auto nx = std::int64_t{volume.dims.x};
  const auto ny = std::int64_t{volume.dims.y};
  const auto nz = std::int64_t{volume.dims.z};
  std::vector<bool> is_open(volume.samples.size(), false);
  std::vector<std::array<std::int64_t, 3>> rest;
  const auto visit = [&](std::int64_t x, std::int64_t y, std::int64_t z) {
    if (x < 0 || y < 0 || z < 0 || x >= nx || y >= ny || z >= nz) return;
    const auto at = static_cast<std::size_t>((z * ny + y) * nx + x);
    if (is_open[at] || volume.samples[at] >= 0) return;
    is_open[at] = true;
    rest.push_back({x, y, z});
  };
  for (std::int64_t z = 0; z < nz; ++z) {
    for (std::int64_t y = 0; y < ny; ++y) {
      for (std::int64_t x = 0; x < nx; ++x) {
        const bool is_border =
            x == 0 || y == 0 || z == 0 || x == nx - 1 || y == ny - 1 || z == nz - 1;
        if (is_border) visit(x, y, z);
      }
    }
  }
  while (!rest.empty()) {
    const auto [x, y, z] = rest.back();
    rest.pop_back();
    for (int edge = 1; edge < 8; ++edge) {  // the seven of the six-way split
      const int i = edge & 1;
      const int j = edge >> 1 & 1;
      const int k = edge >> 2 & 1;
      visit(x + i, y + j, z + k);
      visit(x - i, y - j, z - k);
    }
  }
  return is_open;
}

// Compares the mesh without cavities with that of the volume whose cavities are filled. Returns the
// components that were left out.
std::uint64_t expect_filled(test::SampleVolume<float> volume) {
  Mesh mesh = extracted(volume, true);
  const Dropped dropped = fill_cavities({}, mesh);
  const std::vector<bool> is_open = open_air(volume);
  for (std::size_t n = 0; n < is_open.size(); ++n) {
    if (!is_open[n]) volume.samples[n] = std::max(volume.samples[n], 0.0F);
  }
  const Mesh solid = extracted(volume, true);
  EXPECT_EQ(mesh.triangles.size(), solid.triangles.size());
  EXPECT_EQ(measure_topology(mesh, {}), measure_topology(solid, {}));
  EXPECT_NEAR(measure_extent(mesh, {}).volume_mm3, measure_extent(solid, {}).volume_mm3,
              1e-3 * measure_extent(solid, {}).volume_mm3);
  EXPECT_TRUE(test::is_sound(test::surface_of(mesh)));
  return dropped.components;
}

TEST(Cavities, AreWhatIsOutsideAndNotJoinedToTheBorder) {
  for (const double outside : {0.2, 0.3, 0.4}) {
    EXPECT_GT(expect_filled(test::noise_between<float>(-outside, 1 - outside, {23, 25, 27}, 11)),
              3U);
  }
}

// Boxes of samples that are inside and outside by turns: their vertices lie in few planes, in line
// with those of other components.
TEST(Cavities, OfMasksAreWhatIsOutsideAndNotJoinedToTheBorder) {
  std::mt19937 random(7);
  std::uint64_t dropped = 0;
  for (int volumes = 0; volumes < 60; ++volumes) {
    SCOPED_TRACE(volumes);
    auto volume = test::constant<float>(-1, {16, 16, 16});
    for (std::uint32_t box = 0; box < 6; ++box) {
      std::array<std::uint32_t, 3> low;
      std::array<std::uint32_t, 3> high;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const bool is_nested = box < 3;
        const std::uint32_t size = is_nested ? 13 - 4 * box - random() % 3 : 1 + random() % 3;
        low[axis] = is_nested ? 1 + 2 * box : 1 + random() % (15 - size);
        high[axis] = low[axis] + size;
      }
      for (std::uint32_t z = low[2]; z < high[2]; ++z) {
        for (std::uint32_t y = low[1]; y < high[1]; ++y) {
          for (std::uint32_t x = low[0]; x < high[0]; ++x) {
            volume.at(x, y, z) = box % 2 == 0 ? 1 : -1;
          }
        }
      }
    }
    dropped += expect_filled(volume);
  }
  EXPECT_GT(dropped, 30U);
}

TEST(Cavities, AreTheSameOnAnyNumberOfThreads) {
  const auto volume = test::noise_between<float>(-0.3, 0.7, {23, 25, 70}, 12);
  const auto make = [&] {
    Mesh mesh = extracted(volume, true);
    fill_cavities({}, mesh);
    return mesh;
  };
  test::expect_same_on_any_threads(make, test::kSameBytes);
}

TEST(Cavities, TakeNoMoreMemoryThanTheirBound) {
  const auto volume = test::noise<std::uint8_t>({9, 9, 9, 9, 9, 9, 9, 0}, {40, 40, 40}, 7);
  Mesh mesh = test::extracted(volume, {.iso = 5, .close = true});
  const std::uint64_t bound = filling_memory(mesh.positions.size(), mesh.triangles.size());
  test::HeapPeak peak;
  const Dropped dropped = fill_cavities({}, mesh);
  EXPECT_LE(peak.bytes(), bound);
  EXPECT_GT(dropped.triangles, mesh.triangles.size());
}

TEST(Cavities, OfNothingAreNone) {
  Mesh mesh = test::mesh_of({}, {});
  EXPECT_EQ(fill_cavities({}, mesh).components, 0U);
}

TEST(Cavities, StopWhenTheyAreCancelledAndLeaveTheMesh) {
  std::stop_source stop;
  stop.request_stop();
  Mesh mesh = extracted(test::sample<float>(onion({15, 15, 15}), {31, 31, 31}), false);
  const std::size_t before = mesh.triangles.size();
  EXPECT_EQ(test::code_thrown_by([&] {
              fill_cavities({stop.get_token(), nullptr}, mesh);
            }),
            ErrorCode::kCancelled);
  EXPECT_EQ(mesh.triangles.size(), before);
}

}  // namespace
}  // namespace isomesh::mesh
