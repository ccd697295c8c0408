#include "server/jobs/making/crop.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/shapes.h"

namespace isomesh::jobs {
namespace {

using Triple = std::array<std::uint32_t, 3>;

constexpr Triple kDims = {11, 9, 7};

Geometry flipped() {
  return {
      .origin = {10, -20, 30}, .spacing = {2, 1, 0.5}, .direction = {-1, 0, 0, 0, 0, 1, 0, 1, 0}};
}

SampleArray array_of(const std::vector<std::uint16_t>& samples, const Geometry& geometry) {
  return {SampleType::kUint16, kDims, geometry, reinterpret_cast<const std::byte*>(samples.data())};
}

std::vector<std::uint16_t> numbered() {
  std::vector<std::uint16_t> samples(std::size_t{kDims[0]} * kDims[1] * kDims[2]);
  for (std::size_t n = 0; n < samples.size(); ++n) samples[n] = static_cast<std::uint16_t>(n);
  return samples;
}

bool is_in(const Box& box, const test::Point& point) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (point[axis] < box[0][axis] - 1e-9 || point[axis] > box[1][axis] + 1e-9) return false;
  }
  return true;
}

// Axes that point the other way, and are exchanged: exactly the samples that lie in the box.
TEST(Crop, LeavesTheSamplesInTheBoxWhereTheyAre) {
  const std::vector<std::uint16_t> samples = numbered();
  for (const Geometry& geometry : {Geometry{}, flipped()}) {
    const auto to_space = test::space_of(geometry);
    const test::Point a = test::to_space(to_space, {1.5, 2, 0.7});
    const test::Point b = test::to_space(to_space, {8, 6.9, 5.2});
    Box box;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box[0][axis] = std::min(a[axis], b[axis]);
      box[1][axis] = std::max(a[axis], b[axis]);
    }
    MeshParameters parameters;
    parameters.crop = box;
    const CroppedSamples cropped(array_of(samples, geometry), parameters);
    const SampleArray& array = cropped.array();
    EXPECT_EQ(array.dims, (Triple{7, 5, 5}));
    EXPECT_EQ(cropped.bytes(), 7 * 5 * 5 * sizeof(std::uint16_t));
    EXPECT_EQ(CroppedSamples::most_bytes(parameters, geometry, kDims, SampleType::kUint16),
              cropped.bytes());
    const auto own_space = test::space_of(array.geometry);
    std::size_t n = 0;
    std::size_t seen = 0;
    for (std::uint32_t z = 0; z < kDims[2]; ++z) {
      for (std::uint32_t y = 0; y < kDims[1]; ++y) {
        for (std::uint32_t x = 0; x < kDims[0]; ++x, ++n) {
          const test::Point place = test::to_space(to_space, {double(x), double(y), double(z)});
          if (!is_in(box, place)) continue;
          std::uint16_t value = 0;
          std::memcpy(&value, array.bytes + seen * sizeof value, sizeof value);
          EXPECT_EQ(value, samples[n]);
          const test::Point own = test::to_space(
              own_space, {double(seen % 7), double(seen / 7 % 5), double(seen / 35)});
          for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(own[axis], place[axis], 1e-9);
          ++seen;
        }
      }
    }
    EXPECT_EQ(seen, 7U * 5 * 5);
  }
}

TEST(Crop, OfAVolumeThatLiesAskewHoldsAllOfTheBox) {
  const Geometry geometry = test::oblique_geometry();
  const auto to_space = test::space_of(geometry);
  const test::Point middle = test::to_space(to_space, {5, 4, 3});
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box[0][axis] = middle[axis] - 1.2;
    box[1][axis] = middle[axis] + 1.2;
  }
  const SampleRange range = samples_in(box, geometry, kDims);
  for (std::uint32_t z = 0; z < kDims[2]; ++z) {
    for (std::uint32_t y = 0; y < kDims[1]; ++y) {
      for (std::uint32_t x = 0; x < kDims[0]; ++x) {
        const Triple sample = {x, y, z};
        if (!is_in(box, test::to_space(to_space, {double(x), double(y), double(z)}))) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          EXPECT_GE(sample[axis], range.begin[axis]);
          EXPECT_LT(sample[axis], range.end[axis]);
        }
      }
    }
  }
  EXPECT_LT(range.count(), std::uint64_t{kDims[0]} * kDims[1] * kDims[2]);
}

TEST(Crop, WithoutABoxIsTheVolumeItself) {
  const std::vector<std::uint16_t> samples = numbered();
  const SampleArray whole = array_of(samples, {});
  EXPECT_EQ(CroppedSamples(whole, {}).array().bytes, whole.bytes);
}

TEST(Crop, RefusesABoxWithoutSamples) {
  const Box beside = {{{100, 0, 0}, {200, 8, 8}}};
  const Box thin = {{{0, 0, 2.9}, {8, 8, 3.5}}};
  for (const Box& box : {beside, thin}) {
    const Error error = test::thrown_by([&] { samples_in(box, {}, kDims); }).value();
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_NE(std::string(error.what()).find("crop"), std::string::npos);
    EXPECT_NE(std::string(error.what()).find("from (0, 0, 0) to ("), std::string::npos);
  }
}

// The floats that were copied are not needed beside the integers that they became.
TEST(Crop, OfFloatLabelsHoldsTheIntegersAlone) {
  const std::vector<float> samples(std::size_t{kDims[0]} * kDims[1] * kDims[2], 3);
  const SampleArray array = {SampleType::kFloat32, kDims, Geometry{},
                             reinterpret_cast<const std::byte*>(samples.data())};
  MeshParameters parameters = label_parameters({});
  parameters.crop = Box{{{0, 0, 0}, {4, 4, 4}}};
  const CroppedSamples cropped(array, parameters);
  EXPECT_EQ(cropped.bytes(), 5 * 5 * 5 * sizeof(std::int32_t));
  EXPECT_EQ(CroppedSamples::most_bytes(parameters, {}, kDims, SampleType::kFloat32),
            5 * 5 * 5 * (sizeof(std::int32_t) + sizeof(float)));
}

}  // namespace
}  // namespace isomesh::jobs
