#include "server/import/masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

constexpr std::size_t kMaskSamples = 24;  // 4 x 3 x 2

// A mask whose samples from `begin` to `end` are set.
std::string mask_from(std::size_t begin, std::size_t end, char value = 1) {
  std::string samples(kMaskSamples, '\0');
  std::fill(samples.begin() + static_cast<std::ptrdiff_t>(begin),
            samples.begin() + static_cast<std::ptrdiff_t>(end), value);
  return samples;
}

std::string nifti_mask(std::size_t begin, std::size_t end, char value = 1) {
  return nifti({}, mask_from(begin, end, value));
}

Outcome import_masks_of(const std::vector<Member>& members) {
  return import_bytes(tar(members), {}, {.masks = true});
}

TEST(Masks, AreOneVolumeOfLabels) {
  const Outcome all =
      imported(import_masks_of({{"segmentations/liver.nii.gz", gzip(nifti_mask(12, 20))},
                                {"segmentations/aorta.nii.gz", gzip(nifti_mask(0, 8, 100))},
                                {"segmentations/statistics.json", "{}"}}));
  EXPECT_EQ(all.volume.type, SampleType::kUint8);
  EXPECT_EQ(all.volume.format, "nifti");
  EXPECT_EQ(all.sample_bytes(), mask_from(0, 8, 1).substr(0, 12) + mask_from(12, 20, 2).substr(12));
  ASSERT_THAT(all.volume.labels, SizeIs(2));
  EXPECT_EQ(all.volume.labels[0], (LabelEntry{.label = 1, .name = "aorta"}));
  EXPECT_EQ(all.volume.labels[1], (LabelEntry{.label = 2, .name = "liver"}));
  ASSERT_THAT(all.volume.ignored, SizeIs(1));
  EXPECT_EQ(all.volume.ignored[0].name, "statistics.json");
  EXPECT_FALSE(all.volume.name);
  EXPECT_THAT(codes_of(all), ElementsAre("looks-like-labels"));
}

TEST(Masks, OverlapAsSegmentsDo) {
  const Outcome all = imported(
      import_masks_of({{"heart.nii", nifti_mask(0, 8)}, {"ventricle.nii", nifti_mask(4, 12)}}));
  EXPECT_EQ(all.sample_bytes(), "\1\1\1\1\3\3\3\3\2\2\2\2" + std::string(12, '\0'));
  ASSERT_THAT(all.volume.labels, SizeIs(2));
  EXPECT_THAT(all.volume.labels[0].values, ElementsAre(1, 3));
  EXPECT_THAT(all.volume.labels[1].values, ElementsAre(2, 3));
  EXPECT_THAT(codes_of(all), ElementsAre("overlapping-segments", "looks-like-labels"));
}

TEST(Masks, EmptyOnesKeepTheirNumbersAndAreListed) {
  const std::string empty = nifti_mask(0, 0);
  const Outcome all =
      imported(import_masks_of({{"a.nii", empty}, {"b.nii", nifti_mask(3, 9)}, {"c.nii", empty}}));
  ASSERT_THAT(all.volume.labels, SizeIs(1));
  EXPECT_EQ(all.volume.labels[0], (LabelEntry{.label = 2, .name = "b"}));
  ASSERT_THAT(all.volume.ignored, SizeIs(2));
  EXPECT_EQ(all.volume.ignored[1].name, "c.nii");
  EXPECT_THAT(import_masks_of({{"a.nii", empty}, {"c.nii", empty}}).error, HasSubstr("empty"));
}

// Two names for one structure, such as a lung and its only lobe.
TEST(Masks, IdenticalOnesAreTwoLabels) {
  const Outcome all =
      imported(import_masks_of({{"a.nii", nifti_mask(3, 9)}, {"b.nii", nifti_mask(3, 9)}}));
  ASSERT_THAT(all.volume.labels, SizeIs(2));
  EXPECT_THAT(all.volume.labels[0].values, ElementsAre(3));
  EXPECT_THAT(all.volume.labels[1].values, ElementsAre(3));
}

TEST(Masks, OfFloatsAndOfOtherFormatsWork) {
  std::vector<float> floats(kMaskSamples);
  floats[5] = 1;
  const auto [code, bits] = nifti_type<float>();
  const std::string of_floats = nifti({.datatype = code, .bitpix = bits}, bytes_of(floats));
  const std::string header = metaimage(with(small_metaimage(), "ElementDataFile", "bone.raw"), "");
  // MetaImage's axes are LPS, NIfTI's RAS.
  const NiftiFields turned = {
      .datatype = code, .bitpix = bits, .srow = {-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 0}};
  const Outcome all = imported(import_masks_of({{"skin.nii", nifti(turned, bytes_of(floats))},
                                                {"bone.mhd", header},
                                                {"bone.raw", mask_from(8, 9)}}));
  EXPECT_EQ(all.sample_bytes(),
            std::string(5, '\0') + '\2' + std::string(2, '\0') + '\1' + std::string(15, '\0'));
  EXPECT_THAT(import_masks_of(
                  {{"skin.nii", of_floats}, {"bone.mhd", header}, {"bone.raw", mask_from(8, 9)}})
                  .error,
              AllOf(HasSubstr("\"skin.nii\": "), HasSubstr("\"bone.mhd\"")));
}

std::string float_mask(const std::vector<float>& samples) {
  const auto [code, bits] = nifti_type<float>();
  return nifti({.datatype = code, .bitpix = bits}, bytes_of(samples));
}

// Half of a probability, and a byte of ones that is read with a sign.
TEST(Masks, MayHaveAnyValueInside) {
  std::vector<float> half(kMaskSamples);
  half[5] = 0.5F;
  const auto [code, bits] = nifti_type<std::int8_t>();
  const std::string negative = nifti({.datatype = code, .bitpix = bits}, mask_from(9, 11, '\xff'));
  const std::vector<float> whole(kMaskSamples, -1);
  const Outcome all = imported(import_masks_of(
      {{"a.nii", float_mask(half)}, {"b.nii", negative}, {"c.nii", float_mask(whole)}}));
  std::string expected(kMaskSamples, '\3');
  expected[5] = '\4';
  expected[9] = expected[10] = '\5';
  EXPECT_EQ(all.sample_bytes(), expected);
}

// Resampling leaves traces around a structure, which do not belong to it.
TEST(Masks, OfFloatsMayBeALittleOff) {
  std::vector<float> traces(kMaskSamples, 1e-6F);
  traces[5] = 0.9999F;
  traces[6] = 1;
  const Outcome all = imported(import_masks_of({{"a.nii", float_mask(traces)}}));
  EXPECT_EQ(all.sample_bytes(), mask_from(5, 7));
  traces[5] = 0.9991F;
  traces[6] = 1.0009F;
  EXPECT_EQ(imported(import_masks_of({{"a.nii", float_mask(traces)}})).sample_bytes(),
            mask_from(5, 7));
  traces[7] = 0.4F;
  EXPECT_THAT(import_masks_of({{"a.nii", float_mask(traces)}}).error, HasSubstr("not a mask"));
}

TEST(Masks, OnAnotherGridAreNamed) {
  const Member first = {"a.nii", nifti_mask(0, 8)};
  const Outcome smaller = import_masks_of(
      {first, {"b.nii", nifti({.dim = {3, 4, 2, 3, 1, 1, 1, 1}}, mask_from(3, 9))}});
  EXPECT_THAT(smaller.error, AllOf(HasSubstr("\"b.nii\": "), HasSubstr("4 x 2 x 3 samples"),
                                   HasSubstr("\"a.nii\" has 4 x 3 x 2 samples")));
  EXPECT_EQ(smaller.code, ErrorCode::kUnusableVolume);
  NiftiFields moved;
  moved.srow[3] = 5;
  EXPECT_THAT(import_masks_of({first, {"b.nii", nifti(moved, mask_from(3, 9))}}).error,
              AllOf(HasSubstr("\"b.nii\": "), HasSubstr("up to 5 mm from those of \"a.nii\"")));
  moved.srow[3] = 1e-4;  // the rounding of a header
  EXPECT_TRUE(import_masks_of({first, {"b.nii", nifti(moved, mask_from(3, 9))}}).imported());
}

TEST(Masks, OfSeveralValuesAreNamed) {
  std::string samples = mask_from(0, 8);
  samples[9] = 7;
  for (const std::string& wrong : {samples, std::string(kSmallSamples)}) {
    const Outcome outcome =
        import_masks_of({{"a.nii", nifti_mask(0, 8)}, {"organs.nii", nifti({}, wrong)}});
    EXPECT_THAT(outcome.error, AllOf(HasSubstr("\"organs.nii\": "), HasSubstr("not a mask")));
  }
  EXPECT_THAT(import_masks_of({{"a.nii", nifti_mask(0, 8).substr(0, 360)}}).error,
              HasSubstr("\"a.nii\": The file is truncated"));
}

TEST(Masks, NeedAFolderOfVolumes) {
  const Outcome single = import_bytes(nifti_mask(0, 8), {}, {.masks = true});
  EXPECT_THAT(single.error, HasSubstr("a single file"));
  EXPECT_EQ(single.code, ErrorCode::kInvalidParameter);
  EXPECT_THAT(
      import_bytes(tar({{"a.nii", nifti_mask(0, 8)}}), {}, {.member = "a.nii", .masks = true})
          .error,
      HasSubstr("cannot be combined with masks"));
  EXPECT_EQ(import_masks_of({{"readme.txt", "text"}}).code, ErrorCode::kUnsupportedMedia);
}

TEST(Masks, MoreThanABytesWorthGetLargerSamples) {
  // Files would take seconds.
  const auto written = [](bool is_set, const ImportTask& task) {
    Volume mask;
    mask.dims = {4, 3, 2};
    volume::CanonicalWriter writer(task.target, {mask.dims, mask.type, mask.geometry});
    if (is_set) writer.samples()[0] = std::byte{1};
    mask.range[1] = is_set ? 1 : 0;
    return mask;
  };
  std::vector<Mask> masks;
  for (int n = 0; n < 300; ++n) {
    masks.push_back({"m" + std::to_string(n) + ".nii",
                     [&, n](const ImportTask& task) { return written(n == 299, task); }});
  }
  const Folder folder;
  const Outcome all = imported(outcome_of(folder.path("target"), [&](const auto& target) {
    return import_masks(masks, {.source = {}, .scratch = folder.path(""), .target = target});
  }));
  EXPECT_EQ(all.volume.type, SampleType::kUint16);
  ASSERT_THAT(all.volume.labels, SizeIs(1));
  EXPECT_EQ(all.volume.labels[0], (LabelEntry{.label = 300, .name = "m299"}));
}

TEST(MaskNames, AreThoseOfFilesAsFarAsTheyDiffer) {
  EXPECT_THAT(mask_names({"seg/liver.nii.gz", "seg/lung.left.nrrd", "sub-01_label-GM_mask.nii"}),
              ElementsAre("liver", "lung.left", "GM"));
  EXPECT_THAT(mask_names({"a/liver.nii", "b/liver.nii", "b/aorta.nii"}),
              ElementsAre("a/liver", "b/liver", "aorta"));
  EXPECT_THAT(mask_names({"liver.nii", "liver.nrrd"}), ElementsAre("liver.nii", "liver.nrrd"));
}

}  // namespace
}  // namespace isomesh::import::test
