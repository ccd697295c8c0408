#include "server/mesh/labels/label_voxels.h"

#include <cmath>
#include <limits>
#include <map>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/unit/mesh/separated.h"

namespace isomesh::mesh {
namespace {

template <class T>
std::vector<LabelVoxels> naively_counted(const test::SampleVolume<T>& volume) {
  std::map<std::int64_t, LabelVoxels> found;
  const Dims& dims = volume.dims;
  for (std::size_t i = 0; i < volume.samples.size(); ++i) {
    LabelVoxels& label = found[volume.samples[i]];
    const std::array<std::uint32_t, 3> at = {static_cast<std::uint32_t>(i % dims.x),
                                             static_cast<std::uint32_t>(i / dims.x % dims.y),
                                             static_cast<std::uint32_t>(i / dims.x / dims.y)};
    if (label.voxels++ == 0) label.low = label.high = at;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      label.low[axis] = std::min(label.low[axis], at[axis]);
      label.high[axis] = std::max(label.high[axis], at[axis]);
    }
  }
  std::vector<LabelVoxels> labels;
  const double voxel = std::abs(volume.lattice().to_space.determinant());
  for (auto& [value, label] : found) {
    label.label = value;
    label.volume_mm3 = static_cast<double>(label.voxels) * voxel;
    labels.push_back(label);
  }
  return labels;
}

template <class T>
class CountLabels : public testing::Test {};
TYPED_TEST_SUITE(CountLabels, LabelTypes);

TYPED_TEST(CountLabels, AreThoseOfANaiveWalk) {
  using T = TypeParam;
  constexpr T kLow = std::numeric_limits<T>::min();
  constexpr T kHigh = std::numeric_limits<T>::max();
  const auto volume =
      test::noise<T>({kLow, 0, 0, 0, 9, 100, kHigh}, {13, 9, 70}, 70, test::oblique_geometry());
  for (const int threads : {1, 3}) {
    const test::ThreadCount some(threads);
    EXPECT_EQ(count_labels(volume.lattice(), {}), naively_counted(volume));
  }
}

TEST(CountLabelsOf, CompactLabelsAreThoseOfANaiveWalk) {
  const auto volume = label_cells(12, {70, 21, 40}, 9, 71);
  EXPECT_EQ(count_labels(volume.lattice(), {}), naively_counted(volume));
}

TEST(CountLabelsOf, AnEmptyVolumeAreNone) {
  EXPECT_TRUE(count_labels(test::constant<std::uint8_t>(0, {0, 5, 5}).lattice(), {}).empty());
}

TEST(CountLabelsOf, MoreValuesThanLabelsIsRefused) {
  auto volume = test::constant<std::int32_t>(0, {64, 64, 32});
  for (std::size_t i = 0; i < volume.samples.size(); ++i) {
    volume.samples[i] = static_cast<std::int32_t>(std::min<std::size_t>(i, kMostLabels));
  }
  EXPECT_EQ(count_labels(volume.lattice(), {}).size(), kMostLabels + 1);
  volume.samples.back() = -1;
  EXPECT_EQ(test::code_thrown_by([&] { count_labels(volume.lattice(), {}); }),
            ErrorCode::kUnusableVolume);
}

TEST(CountLabelsOf, ACancelledJobEnds) {
  std::stop_source source;
  source.request_stop();
  const auto volume = label_noise(4, {9, 9, 9}, 72);
  EXPECT_EQ(test::code_thrown_by([&] {
              count_labels(volume.lattice(), {source.get_token(), {}});
            }),
            ErrorCode::kCancelled);
}

std::vector<LabelVoxels> present(const std::vector<std::int64_t>& labels) {
  std::vector<LabelVoxels> result;
  for (const std::int64_t label : labels) result.push_back({.label = label, .voxels = 1});
  return result;
}

TEST(SelectLabels, AreAllButTheBackground) {
  EXPECT_EQ(select_labels(present({-1, 0, 2, 5}), 0), (std::vector<std::int64_t>{-1, 2, 5}));
  EXPECT_EQ(select_labels(present({-1, 0, 2, 5}), 2), (std::vector<std::int64_t>{-1, 0, 5}));
  EXPECT_EQ(select_labels(present({1, 2}), 0), (std::vector<std::int64_t>{1, 2}));
  EXPECT_TRUE(select_labels(present({0}), 0).empty());
}

TEST(SelectLabels, AreThoseThatAreWantedInOrderAndOnce) {
  EXPECT_EQ(select_labels(present({0, 1, 2, 5}), 0, std::vector<std::int64_t>{5, 1, 5}),
            (std::vector<std::int64_t>{1, 5}));
}

TEST(SelectLabels, NamesThoseThatAreNotThere) {
  const auto error = test::thrown_by([] {
    select_labels(present({0, 1, 2}), 0, std::vector<std::int64_t>{7, 1, -3});
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnusableVolume);
  EXPECT_STREQ(error->what(), "the volume has no voxels of the labels -3, 7");
  const auto many =
      test::thrown_by([] { select_labels(present({0}), 0, consecutive<std::int64_t>(1, 50)); });
  ASSERT_TRUE(many);
  EXPECT_TRUE(std::string(many->what()).ends_with("19, 20 and 30 more"));
}

TEST(SelectLabels, RefusesTheBackgroundAndNone) {
  for (const std::vector<std::int64_t>& wanted :
       {std::vector<std::int64_t>{}, std::vector<std::int64_t>{1, 0}}) {
    const auto error = test::thrown_by([&] { select_labels(present({0, 1}), 0, wanted); });
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code(), ErrorCode::kInvalidParameter);
    EXPECT_EQ(test::fields_of(*error), std::vector<std::string>{"labels"});
  }
}

TEST(SelectLabels, RefusesMoreThanThereMayBe) {
  const auto values = consecutive<std::int64_t>(1, kMostLabels + 1);
  EXPECT_EQ(select_labels(present(values), 1).size(), kMostLabels);
  EXPECT_EQ(test::code_thrown_by([&] { select_labels(present(values), 0); }),
            ErrorCode::kUnusableVolume);
}

}  // namespace
}  // namespace isomesh::mesh
