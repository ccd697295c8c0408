#include "server/mesh/labels/voxel_faces.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <map>
#include <set>
#include <stop_token>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/any_threads.h"
#include "tests/support/errors.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

using Pair = std::pair<std::size_t, std::size_t>;  // as in WallArea
using Faces = std::map<Pair, std::uint64_t>;

// The numbers of the labels that a value belongs to.
std::set<std::size_t> labels_of_value(std::int64_t value, const SeparateOptions& options) {
  std::set<std::size_t> labels;
  for (std::size_t n = 0; n < options.labels.size(); ++n) {
    const auto own = options.values.find(options.labels[n]);
    const bool is_own = own == options.values.end() ? value == options.labels[n]
                                                    : std::ranges::count(own->second, value) > 0;
    if (is_own) labels.insert(n + 1);
  }
  return labels;
}

void add_face(const std::set<std::size_t>& one, const std::set<std::size_t>& other, Faces& faces) {
  std::set<std::size_t> only_one;
  std::set<std::size_t> only_other;
  std::ranges::set_difference(one, other, std::inserter(only_one, only_one.end()));
  std::ranges::set_difference(other, one, std::inserter(only_other, only_other.end()));
  if (only_one.empty() && only_other.empty()) return;
  if (only_one.empty()) only_one = {0};
  if (only_other.empty()) only_other = {0};
  for (const std::size_t a : only_one) {
    for (const std::size_t b : only_other) {
      ++faces[a == 0 || (b != 0 && b < a) ? Pair(b, a) : Pair(a, b)];
    }
  }
}

// Looks at both sides of each face of the lattice, one after the other.
template <class T>
Faces naively_counted(const test::SampleVolume<T>& volume, const SeparateOptions& options) {
  const Dims& dims = volume.dims;
  Faces faces;
  const auto labels_at = [&](std::array<std::int64_t, 3> at) -> std::set<std::size_t> {
    const std::array<std::int64_t, 3> size = {dims.x, dims.y, dims.z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (at[axis] < 0 || at[axis] >= size[axis]) return {};
    }
    const auto index = static_cast<std::size_t>((at[2] * dims.y + at[1]) * dims.x + at[0]);
    return labels_of_value(volume.samples[index], options);
  };
  const std::int64_t margin = options.close ? 1 : 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::int64_t z = -margin; z < dims.z + margin; ++z) {
      for (std::int64_t y = -margin; y < dims.y + margin; ++y) {
        for (std::int64_t x = -margin; x < dims.x + margin; ++x) {
          std::array<std::int64_t, 3> next = {x, y, z};
          ++next[axis];
          const std::array<std::int64_t, 3> end = {dims.x + margin, dims.y + margin,
                                                   dims.z + margin};
          if (next[axis] < end[axis]) add_face(labels_at({x, y, z}), labels_at(next), faces);
        }
      }
    }
  }
  return faces;
}

template <class T>
std::vector<WallArea> walls_of(const test::SampleVolume<T>& volume,
                               const SeparateOptions& options) {
  const VoxelFaces faces = count_faces(volume.lattice(), options, {});
  return measure_walls(separated(volume, options), faces, {});
}

template <class T>
Faces counted(const test::SampleVolume<T>& volume, const SeparateOptions& options) {
  Faces faces;
  for (const WallArea& wall : walls_of(volume, options)) {
    if (wall.faces > 0) faces[{wall.a, wall.b}] = wall.faces;
  }
  return faces;
}

template <class T>
class VoxelFacesOf : public testing::Test {};
TYPED_TEST_SUITE(VoxelFacesOf, LabelTypes);

TYPED_TEST(VoxelFacesOf, RandomLabelsAreThoseOfANaiveWalk) {
  const auto volume = test::noise<TypeParam>({0, 1, 2, 3, 100}, {13, 9, 7}, 31);
  for (const SeparateOptions& options : all_separations({1, 2, 100})) {
    EXPECT_EQ(counted(volume, options), naively_counted(volume, options))
        << describe(volume.dims, options);
  }
}

// Rows and runs that are longer than what one step of the count takes, and rows of several tasks.
TEST(VoxelFaces, OfCompactLabelsAreThoseOfANaiveWalkOnAnyNumberOfThreads) {
  for (const Dims& dims : {Dims{150, 70, 60}, Dims{1, 5, 4000}, Dims{3, 5000, 2}, Dims{1, 1, 1}}) {
    const auto volume = label_cells(12, dims, 40, 71);
    const SeparateOptions options = {.labels = consecutive<std::int64_t>(1, 12), .close = true};
    const auto faces = test::expect_same_on_any_threads(
        [&] { return count_faces(volume.lattice(), options, {}); });
    EXPECT_EQ(counted(volume, options), naively_counted(volume, options));
    EXPECT_FALSE(faces.empty());
  }
}

TEST(VoxelFaces, OfJoinedAndOverlappingLabelsAreThoseOfANaiveWalk) {
  const auto volume = label_noise(7, {9, 8, 7}, 5);
  for (const bool close : {false, true}) {
    const SeparateOptions joined = {.labels = {1, 2, 50}, .close = close, .values = {{50, {3, 4}}}};
    EXPECT_EQ(counted(volume, joined), naively_counted(volume, joined));
    const SeparateOptions overlapping = {
        .labels = {1, 2, 50}, .close = close, .values = {{1, {1, 3}}, {50, {3, 4, 2}}}};
    EXPECT_EQ(counted(volume, overlapping), naively_counted(volume, overlapping));
  }
}

// Any pair that shares a face has a wall where the lattice has cells.
TEST(VoxelFaces, ArePartOfWalls) {
  const auto volume = label_noise(20, {9, 8, 7}, 8);
  for (const SeparateOptions& options : all_separations(consecutive<std::int64_t>(1, 19))) {
    for (const WallArea& wall : walls_of(volume, options)) {
      EXPECT_GT(wall.area_mm2, 0) << wall.a << " " << wall.b;
    }
  }
}

// A cube of eight voxels, mirrored along the axes whose bits are set.
test::SampleVolume<std::uint8_t> cube_of_eight(std::uint32_t mirrored) {
  auto volume = test::constant<std::uint8_t>(0, {6, 6, 6});
  for (std::uint32_t n = 0; n < 8; ++n) {
    const std::uint32_t at = n ^ mirrored;
    volume.at(2 + at % 2, 2 + at / 2 % 2, 2 + at / 4) = static_cast<std::uint8_t>(n + 1);
  }
  return volume;
}

// Each voxel shares faces with three others and three faces with the background; walls are between
// more pairs, which depend on the lattice.
TEST(VoxelFaces, OfACubeOfEightLabelsAreTheSameInAllMirrorImages) {
  const SeparateOptions options = {.labels = consecutive<std::int64_t>(1, 8)};
  const Faces faces = counted(cube_of_eight(0), options);
  EXPECT_EQ(faces.size(), 12U + 8U);
  for (const auto& [pair, count] : faces) EXPECT_EQ(count, pair.second == 0 ? 3U : 1U);
  for (std::uint32_t mirrored = 1; mirrored < 8; ++mirrored) {
    const auto volume = cube_of_eight(mirrored);
    EXPECT_EQ(counted(volume, options), faces);
    EXPECT_GT(walls_of(volume, options).size(), faces.size());
  }
}

TEST(VoxelFaces, AreCountedUntilTheJobIsCancelled) {
  const auto volume = label_noise(3, {9, 8, 7}, 8);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(test::code_thrown_by([&] {
              count_faces(volume.lattice(), {.labels = {1, 2}}, {stop.get_token(), {}});
            }),
            ErrorCode::kCancelled);
}

}  // namespace
}  // namespace isomesh::mesh
