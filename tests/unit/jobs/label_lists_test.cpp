#include "server/jobs/library/label_lists.h"

#include <map>
#include <random>

#include <gmock/gmock.h>

#include "proto/json.h"
#include "tests/support/errors.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using testing::ElementsAre;

class LabelListsTest : public test::JobsFixture {
 protected:
  // Turned, mirrored and stretched, so that no axis is like another. The volume has the samples
  // along the patient's axes: x is the j of the upload, y is its i backwards.
  static Geometry crooked() {
    return {
        .origin = {10, -20, 30}, .spacing = {0.5, 2, 3}, .direction = {0, 1, 0, -1, 0, 0, 0, 0, 1}};
  }

  template <class Sample>
  Volume add_samples(const std::vector<Sample>& samples, const std::array<std::uint32_t, 3>& dims,
                     SampleType type) {
    const std::string bytes(reinterpret_cast<const char*>(samples.data()),
                            samples.size() * sizeof(Sample));
    return add_raw(bytes, {.dims = dims, .type = type, .geometry = crooked(), .big_endian = false});
  }

  // 4 x 3 x 2 samples: a 7 and two 9s.
  Volume add_three_voxels() {
    std::vector<std::int16_t> samples(24);
    samples[1] = 7;                 // (1, 0, 0), in the volume (0, 2, 0)
    samples[14] = samples[19] = 9;  // (2, 0, 1) and (3, 1, 1), in the volume (0, 1, 1), (1, 0, 1)
    return add_samples(samples, {4, 3, 2}, SampleType::kInt16);
  }

  LabelLists lists_{blobs_};
};

TEST_F(LabelListsTest, TellsWhatTheSamplesHave) {
  const Volume volume = add_three_voxels();
  const VolumeLabels list = lists_.of("", volume, 0);
  EXPECT_EQ(list.volume, volume.id);
  EXPECT_EQ(list.background, 0);
  const VolumeLabel seven = {.label = 7,
                             .voxels = 1,
                             .volume_mm3 = 3,
                             .low = {0, 2, 0},
                             .high = {0, 2, 0},
                             .bounds = {{{9, -20.75, 28.5}, {11, -20.25, 31.5}}}};
  const VolumeLabel nine = {.label = 9,
                            .voxels = 2,
                            .volume_mm3 = 6,
                            .low = {0, 0, 1},
                            .high = {1, 1, 1},
                            .bounds = {{{9, -21.75, 31.5}, {13, -20.75, 34.5}}}};
  EXPECT_THAT(list.labels, ElementsAre(seven, nine));
  EXPECT_EQ(lists_.page_of("", volume, 0, {}), list);
}

TEST_F(LabelListsTest, TheBackgroundMayBeAnotherValue) {
  const VolumeLabels list = lists_.of("", add_three_voxels(), 9);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[0].label, 0);
  EXPECT_EQ(list.labels[0].voxels, 21U);
  EXPECT_EQ(list.labels[1].label, 7);
}

TEST_F(LabelListsTest, NamesAreThoseOfTheFile) {
  Volume volume = add_three_voxels();
  volume.labels = {{.label = 3, .name = "spleen"},  // has no voxel
                   {.label = 9, .name = "liver", .color = "#ff8000"}};
  const VolumeLabels list = lists_.of("", volume, 0);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[0].name, std::nullopt);
  EXPECT_EQ(list.labels[1].name, "liver");
  EXPECT_EQ(list.labels[1].color, "#ff8000");
}

// As where 9 is what both have.
TEST_F(LabelListsTest, AVoxelMayBelongToSeveralLabels) {
  Volume volume = add_three_voxels();
  volume.labels = {{.label = 1, .name = "liver", .values = {1, 9}},
                   {.label = 7, .name = "tumour", .values = {7, 9}}};
  const VolumeLabels list = lists_.of("", volume, 0);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[0].label, 1);
  EXPECT_EQ(list.labels[0].voxels, 2U);
  EXPECT_EQ(list.labels[1].label, 7);
  EXPECT_EQ(list.labels[1].voxels, 3U);
  EXPECT_EQ(list.labels[1].volume_mm3, 9);
  EXPECT_EQ(list.labels[1].low, (std::array<std::uint32_t, 3>{0, 0, 0}));
  EXPECT_EQ(list.labels[1].high, (std::array<std::uint32_t, 3>{1, 2, 1}));
}

// Planes and volumes that are cut into blocks of 4 MiB.
TEST_F(LabelListsTest, BlocksAreCountedAsOne) {
  using Dims = std::array<std::uint32_t, 3>;
  for (const Dims& dims : {Dims{1100, 1200, 3}, Dims{300, 300, 40}}) {
    std::vector<std::int32_t> samples(std::size_t{dims[0]} * dims[1] * dims[2]);
    std::mt19937 random(1);
    std::map<std::int64_t, VolumeLabel> expected;
    for (std::size_t at = 0; at < samples.size(); ++at) {
      if (random() % 1000 != 0) continue;
      samples[at] = static_cast<std::int32_t>(random() % 5) - 2;
      if (samples[at] == 0) continue;
      VolumeLabel& label = expected[samples[at]];
      const Dims place = {static_cast<std::uint32_t>(at / dims[0] % dims[1]),
                          static_cast<std::uint32_t>(dims[0] - 1 - at % dims[0]),
                          static_cast<std::uint32_t>(at / dims[0] / dims[1])};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        label.low[axis] = label.voxels == 0 ? place[axis] : std::min(label.low[axis], place[axis]);
        label.high[axis] = std::max(label.high[axis], place[axis]);
      }
      ++label.voxels;
    }
    const VolumeLabels list = lists_.of("", add_samples(samples, dims, SampleType::kInt32), 0);
    ASSERT_EQ(list.labels.size(), expected.size());
    for (const VolumeLabel& label : list.labels) {
      EXPECT_EQ(label.voxels, expected[label.label].voxels);
      EXPECT_EQ(label.low, expected[label.label].low);
      EXPECT_EQ(label.high, expected[label.label].high);
      EXPECT_EQ(label.volume_mm3, 3 * static_cast<double>(label.voxels));
    }
  }
}

TEST_F(LabelListsTest, SixteenBitsOfLabelsAreTheMost) {
  std::vector<std::int32_t> samples(64 * 64 * 17);
  for (std::size_t at = 0; at < samples.size(); ++at) {
    samples[at] = static_cast<std::int32_t>(std::min<std::size_t>(at, Volume::kMostLabels));
  }
  const Volume most = add_samples(samples, {64, 64, 17}, SampleType::kInt32);
  EXPECT_EQ(lists_.of("", most, 0).labels.size(), Volume::kMostLabels);
  EXPECT_EQ(test::code_thrown_by([&] { lists_.of("", most, -1); }), ErrorCode::kUnusableVolume);
  for (std::size_t at = 0; at < samples.size(); ++at) samples[at] = static_cast<std::int32_t>(at);
  const Volume more = add_samples(samples, {64, 64, 17}, SampleType::kInt32);
  EXPECT_EQ(test::code_thrown_by([&] { lists_.of("", more, 0); }), ErrorCode::kUnusableVolume);
}

TEST_F(LabelListsTest, ComeInPages) {
  std::vector<std::int32_t> samples(8 * 8 * 9);
  for (std::size_t at = 0; at < samples.size(); ++at) samples[at] = static_cast<std::int32_t>(at);
  const Volume volume = add_samples(samples, {8, 8, 9}, SampleType::kInt32);
  std::int64_t last = 0;
  std::optional<std::int64_t> after;
  for (const std::size_t expected : {256U, 256U, 63U}) {
    const VolumeLabels page = lists_.page_of("", volume, 0, after);
    ASSERT_EQ(page.labels.size(), expected);
    for (const VolumeLabel& label : page.labels) EXPECT_EQ(label.label, ++last);
    EXPECT_EQ(page.next, expected < 256 ? std::nullopt : std::optional(std::to_string(last)));
    after = last;
  }
  EXPECT_THAT(lists_.page_of("", volume, 0, last).labels, testing::IsEmpty());
}

TEST_F(LabelListsTest, FractionsAreNoLabels) {
  std::vector<float> samples(24, 1);
  samples[7] = 2.9995F;
  const auto add_floats = [&] { return add_samples(samples, {4, 3, 2}, SampleType::kFloat32); };
  const VolumeLabels list = lists_.of("", add_floats(), 0);
  ASSERT_EQ(list.labels.size(), 2U);
  EXPECT_EQ(list.labels[1].label, 3);
  EXPECT_EQ(list.labels[1].voxels, 1U);
  samples[8] = 0.5;
  const Volume volume = add_floats();
  EXPECT_EQ(test::code_thrown_by([&] { lists_.of("", volume, 0); }), ErrorCode::kUnusableVolume);
}

TEST_F(LabelListsTest, SamplesThatAreCutMeanwhileAreDamaged) {
  const Volume volume = add_sphere();
  const test::CutBlobs cut(data_);
  LabelLists lists(cut);
  EXPECT_EQ(test::code_thrown_by([&] { lists.of("", volume, 0); }), ErrorCode::kUnusableVolume);
}

// An answer that comes at once would tell that somebody else has the volume, too.
TEST_F(LabelListsTest, AreCountedForEachViewer) {
  const Volume volume = add_three_voxels();
  lists_.page_of("one", volume, 0, {});
  blobs_.erase(volume.samples);
  EXPECT_NO_THROW(lists_.page_of("one", volume, 1, {}));
  EXPECT_EQ(test::code_thrown_by([&] { lists_.page_of("two", volume, 0, {}); }),
            ErrorCode::kUnusableVolume);
}

}  // namespace
}  // namespace isomesh::jobs
