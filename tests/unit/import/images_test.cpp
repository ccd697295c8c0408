// Stacks of TIFF, PNG and BMP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/images/natural_order.h"
#include "server/import/images/tiff_meaning.h"
#include "tests/support/errors.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::HasSubstr;
using Vector = std::array<double, 3>;
using Dims = std::array<std::uint32_t, 3>;

const std::string kSamples(kSmallSamples);
const std::string kFirst = kSamples.substr(0, 12);
const std::string kSecond = kSamples.substr(12);
const ImportOptions kSpaced = {.spacing = Vector{1, 2, 3}};

TEST(NaturalOrder, ComparesNumbersByValue) {
  EXPECT_TRUE(comes_before("a9.png", "a10.png"));
  EXPECT_FALSE(comes_before("a10.png", "a9.png"));
  EXPECT_TRUE(comes_before("a2b10", "a10b2"));
  EXPECT_TRUE(comes_before("a01", "a1"));
  EXPECT_FALSE(comes_before("a1", "a1"));
  EXPECT_TRUE(comes_before("a", "a1"));
  EXPECT_TRUE(comes_before("99999999999999999999998", "99999999999999999999999"));
}

TEST(NaturalOrder, NamesTheFirstNumberThatIsMissing) {
  EXPECT_EQ(missing_between({"s08.tif", "s09.tif", "s11.tif"}), "s10.tif");
  EXPECT_EQ(missing_between({"s0.tif", "s2.tif", "s4.tif"}), "");
  EXPECT_EQ(missing_between({"s0.tif", "s2.tif", "s6.tif", "s8.tif"}), "s4.tif");
  EXPECT_EQ(missing_between({"a.tif", "b.tif", "d.tif"}), "");
  EXPECT_EQ(missing_between({"a1b2", "a1b3", "a1b5"}), "a1b4");
  EXPECT_EQ(missing_between({"1", "3"}), "");
}

TEST(NaturalOrder, PatternsLeaveNumbersOut) {
  EXPECT_EQ(name_pattern("img_000_DAPI_12.tif"), "img_*_DAPI_*.tif");
  EXPECT_EQ(name_pattern("s-1"), name_pattern("s0"));
  EXPECT_EQ(name_pattern("z_1.25.png"), name_pattern("z_-2.png"));
  EXPECT_EQ(name_pattern("2020-01-02"), "*-*-*");
  EXPECT_EQ(name_pattern("1.2.840"), "*.*.*");
}

// The names in their order, or the error.
std::string sorted(const std::vector<std::string>& names) {
  std::string result;
  try {
    for (const std::size_t at : slice_order(names)) result += names[at] + " ";
  } catch (const Error& error) {
    return error.what();
  }
  return result;
}

TEST(NaturalOrder, DecimalAndNegativeNumbersAreOrderedByValue) {
  EXPECT_EQ(sorted({"z_0.25", "z_0.5", "z_0.75", "z_1.0"}), "z_0.25 z_0.5 z_0.75 z_1.0 ");
  EXPECT_EQ(sorted({"z_0.75", "z_0.25", "z_0.5"}), "z_0.25 z_0.5 z_0.75 ");
  EXPECT_EQ(sorted({"z_1.5", "z_1", "z_2"}), "z_1 z_1.5 z_2 ");
  EXPECT_EQ(sorted({"s0", "s1", "s-1", "s-2"}), "s-2 s-1 s0 s1 ");
  EXPECT_EQ(sorted({"s_2.5", "s_-2.5", "s_0.0"}), "s_-2.5 s_0.0 s_2.5 ");
  EXPECT_EQ(sorted({"s1.9", "s1.10", "s1.11"}), "s1.9 s1.10 s1.11 ");
  EXPECT_THAT(sorted({"s1.2", "s1.10", "s1.1"}), HasSubstr("missing"));
  EXPECT_EQ(sorted({"a.0.1.8", "a.0.1.10", "a.0.1.9"}), "a.0.1.8 a.0.1.9 a.0.1.10 ");
}

TEST(NaturalOrder, ClearOrdersAreKept) {
  using Names = std::vector<std::string>;
  for (const Names& names :
       {// The minus separates.
        Names{"\u5934\u90e8-001.png", "\u5934\u90e8-002.png", "\u5934\u90e8-003.png"},
        {"Thorax (2)-001", "Thorax (2)-002", "Thorax (2)-003"},
        {"scan--001", "scan--002", "scan--003"},
        {"CT -001", "CT -002", "CT -003"},
        {"CT_-001", "CT_-002", "CT_-003"},
        {"[a]-01", "[a]-02", "[a]-03"},
        {"ct.-01", "ct.-02", "ct.-03"},
        {"s_-0", "s_-5", "s_-10"},
        {"s-2", "s-6", "s-10"},
        {"study-1.1", "study-1.2", "study-1.3"},
        // The first number orders them, or all together.
        {"scan_12-05-58", "scan_12-05-59", "scan_12-06-00", "scan_12-06-01"},
        {"IMG_20240105_235959_001", "IMG_20240106_000000_002"},
        {"IM000_z100.0", "IM001_z99.5", "IM002_z99.0"},
        {"slice_000_8f3a", "slice_001_1b2c", "slice_002_0031", "slice_005_7e1d"},
        {"slice_0_83", "slice_1_12", "slice_2_31"},
        {"s1_0.25mm", "s2_0.50mm"},
        // Decimals are rounded, or count within a unit.
        {"z0.0", "z0.2", "z0.5", "z0.8", "z1.0"},
        {"1.1", "1.2", "1.3", "2.1", "2.2", "2.3"},
        {"1.8", "1.9", "1.10", "2.1", "2.2"},
        {"1", "2", "3", "4", "5", "10.0"},
        // No numbers, or hexadecimal ones.
        {"a", "b", "c"},
        {"0e", "0f", "10", "11"},
        {"S1.png", "s2.PNG", "S10.png"},
        {"s.png", "s_2.png", "s_10.png"}}) {
    std::string expected;
    for (const std::string& name : names) expected += name + " ";
    EXPECT_EQ(sorted({names.rbegin(), names.rend()}), expected);
  }
}

TEST(NaturalOrder, UnclearOrdersAndGapsAreRefused) {
  EXPECT_THAT(sorted({"z_0.5", "z_0.25"}), HasSubstr("is not clear"));
  EXPECT_THAT(sorted({"z_0.25", "z_0.5", "z_1.0"}), HasSubstr("is not clear"));
  EXPECT_THAT(sorted({"s_-5.5.png", "s_-8.0.png", "s_-10.5.png"}), HasSubstr("is not clear"));
  EXPECT_THAT(sorted({"s-2", "s-1", "s1"}), HasSubstr("missing between s-1 and s1"));
  EXPECT_THAT(sorted({"c1_z1", "c1_z2", "c2_z1", "c2_z2"}), HasSubstr("c1_z2 and c2_z1"));
}

TEST(TiffMeaning, PagesAreOrderedAsOmeSays) {
  const std::string ome =
      "<OME xmlns='x'><Image><Pixels DimensionOrder=\"XYZCT\" SizeZ=\"3\" SizeC=\"2\" SizeT=\"1\" "
      "PhysicalSizeX=\"0.5\" PhysicalSizeY=\"0.5\" PhysicalSizeZ=\"2\" "
      "PhysicalSizeZUnit=\"mm\"/></Image></OME>";
  const TiffMeaning meaning = tiff_meaning(ome, {}, 6);
  EXPECT_EQ(meaning.page_of(1, 2), 5);
  EXPECT_EQ(meaning.spacing, (Vector{0.0005, 0.0005, 2}));
  check_pages(meaning, 6);
  const TiffMeaning cut = tiff_meaning(ome, {}, 5);
  EXPECT_TRUE(isomesh::test::thrown_by([&] { cut.page_of(1, 2); }));
}

TEST(TiffMeaning, ImageJCountsChannelsFirst) {
  const TiffMeaning meaning = tiff_meaning(
      "ImageJ=1.53\nimages=12\nchannels=2\nslices=3\nframes=2\nunit=\\u00B5m\nspacing=4\n", {2, 4},
      12);
  EXPECT_EQ(meaning.page_of(3, 2), 6 + 2 * 2 + 1);  // the second channel at the second time
  EXPECT_EQ(meaning.spacing, (Vector{0.0005, 0.00025, 0.004}));
  EXPECT_FALSE(tiff_meaning("ImageJ=1\nimages=3\nunit=pixel\nspacing=1\n", {1, 1}, 3).spacing);
  EXPECT_EQ(tiff_meaning("a scan", {72, 72}, 3).slices, 3);
}

TEST(TiffMeaning, ImageJHasUnitsOfEachAxis) {
  const std::string begin = "ImageJ=1.53t\nimages=3\nslices=3\nunit=mm\nspacing=3000\n";
  EXPECT_EQ(tiff_meaning(begin + "zunit=micron\n", {2, 4}, 3).spacing, (Vector{0.5, 0.25, 3}));
  EXPECT_EQ(tiff_meaning(begin + "yunit=cm\nzunit=nm\n", {2, 4}, 3).spacing,
            (Vector{0.5, 2.5, 0.003}));
  EXPECT_FALSE(tiff_meaning(begin + "zunit=sec\n", {2, 4}, 3).spacing);
}

TEST(Tiff, ValuesAreCalibratedAsInImageJ) {
  const auto of = [](const std::string& calibration) {
    return import_bytes(tiff({kFirst, kSecond}, "ImageJ=1.53t\nimages=2\nslices=2\n" + calibration),
                        {}, kSpaced);
  };
  const Outcome outcome = imported(of("cf=0\nc0=-100\nc1=0.5\nvunit=Gray Value\n"));
  EXPECT_EQ(samples_of<float>(outcome)[0], static_cast<float>(kFirst[0]) * 0.5F - 100);
  EXPECT_THAT(codes_of(outcome), Contains("values-rescaled"));
  for (const char* same : {"cf=20\n", "cf=0\nc0=0\nc1=1\n", "cf=0\nvunit=none\n"}) {
    EXPECT_EQ(of(same).sample_bytes(), kSamples) << same;
  }
  EXPECT_THAT(of("cf=7\nc0=1\nc1=2\nc2=3\nc3=4\n").error, HasSubstr("its function \"7\""));
  EXPECT_THAT(of("cf=21\n").error, HasSubstr("Convert the image to 32 bits"));
  EXPECT_THAT(of("cf=0\nc0=1\nc1=0\n").error, HasSubstr("is not a straight line"));
}

TEST(Tiff, FilesOfAFolderHaveOneCalibrationAndSpacing) {
  const auto of = [](const std::string& first, const std::string& second,
                     const ImportOptions& options) {
    return import_bytes(
        zip({{"s1.tif", tiff({kFirst}, first)}, {"s2.tif", tiff({kSecond}, second)}}), {}, options);
  };
  const std::string signed_values = "ImageJ=1.53t\ncf=0\nc0=-32768\nc1=1\n";
  const Outcome outcome = imported(of(signed_values, signed_values, kSpaced));
  EXPECT_EQ(samples_of<float>(outcome)[0], static_cast<float>(kFirst[0]) - 32768);
  EXPECT_THAT(codes_of(outcome), Contains("values-rescaled"));
  EXPECT_THAT(of(signed_values, "ImageJ=1.53t\n", kSpaced).error,
              HasSubstr("\"s2.tif\": Its values are calibrated otherwise"));
  // Each file tells of the whole volume.
  const auto ome = [](const std::string& between) {
    return "<OME><Image><Pixels DimensionOrder='XYZCT' SizeZ='2' PhysicalSizeX='1000' "
           "PhysicalSizeY='2000' PhysicalSizeZ='" +
           between + "'/></Image></OME>";
  };
  const Outcome spaced = imported(of(ome("3000"), ome("3000"), {}));
  EXPECT_EQ(spaced.volume.geometry.spacing, (Vector{1, 2, 3}));
  EXPECT_THAT(of(ome("3000"), ome("4000"), {}).error, HasSubstr("spacing=X,Y,Z"));
}

TEST(Tiff, PagesAreSlices) {
  const std::string file = tiff({kFirst, kSecond});
  EXPECT_THAT(import_bytes(file).error, HasSubstr("spacing=X,Y,Z"));
  const Outcome outcome = imported(import_bytes(file, {}, kSpaced));
  EXPECT_EQ(outcome.volume.format, "tiff");
  EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{1, 2, 3}));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_THAT(codes_of(outcome), Contains("space-assumed"));
  EXPECT_THAT(import_bytes(tiff({kFirst})).error, HasSubstr("1 slice of 4 x 3 samples"));
}

TEST(Tiff, TheDescriptionGivesSpacingAndVolumes) {
  const Outcome spaced = imported(import_bytes(
      tiff({kFirst, kSecond},
           "<OME><Image><Pixels DimensionOrder='XYCZT' SizeZ='2' SizeC='1' SizeT='1' "
           "PhysicalSizeX='1' PhysicalSizeY='2' PhysicalSizeZ='3' PhysicalSizeXUnit='mm' "
           "PhysicalSizeYUnit='mm' PhysicalSizeZUnit='mm'></Pixels></Image></OME>")));
  EXPECT_EQ(spaced.volume.geometry.spacing, (Vector{1, 2, 3}));
  ImportOptions second = kSpaced;
  second.volume = 1;
  const std::string description = "ImageJ=1\nimages=4\nchannels=2\nslices=2\n";
  const std::string file = tiff({kFirst, kSecond, kFirst, kFirst}, description);
  EXPECT_EQ(import_bytes(file).remedy.choices.size(), 2);
  EXPECT_EQ(import_bytes(file, {}, second).sample_bytes(), kSecond + kFirst);
}

TEST(Tiff, EveryTruncationIsRefused) {
  const std::string file = tiff({kFirst, kSecond});
  constexpr std::size_t kLink = 4;  // to no further page
  for (std::size_t size = 0; size + kLink < file.size(); ++size) {
    const Outcome outcome = import_bytes(file.substr(0, size), {}, kSpaced);
    EXPECT_FALSE(outcome.imported()) << size;
    EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
  }
}

TEST(Images, AreStackedInTheOrderOfTheirNumbers) {
  for (const auto& [first, second, format] :
       {std::tuple{grey_png(4, kFirst), grey_png(4, kSecond), "png"},
        {grey_bmp(4, kFirst), grey_bmp(4, kSecond), "bmp"},
        {tiff({kFirst}), tiff({kSecond}), "tiff"}}) {
    const Outcome outcome = import_bytes(
        zip({{"scan/s10", second}, {"scan/s9", first}, {"scan/notes.txt", "text"}}), {}, kSpaced);
    ASSERT_EQ(outcome.error, "") << format;
    EXPECT_EQ(outcome.volume.format, format);
    EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_EQ(outcome.volume.ignored.size(), 1);
    EXPECT_THAT(import_bytes(first).error, HasSubstr("1 slice of 4 x 3 samples"));
  }
}

TEST(Images, MissingAndDifferentOnesAreNamed) {
  const std::string image = grey_png(4, kFirst);
  EXPECT_THAT(
      import_bytes(zip({{"s1.png", image}, {"s2.png", image}, {"s4.png", image}}), {}, kSpaced)
          .error,
      HasSubstr("s3.png"));
  const Outcome differs =
      import_bytes(zip({{"s1.png", image}, {"s2.png", grey_png(3, kFirst)}}), {}, kSpaced);
  EXPECT_THAT(differs.error, HasSubstr("\"s2.png\": The pages differ"));
}

Outcome import_pictures(const std::vector<std::string>& names, const std::string& member = {}) {
  std::vector<Member> members;
  char letter = 'a';
  for (const std::string& name : names) {
    const std::string samples(12, letter++);
    members.push_back(
        {name, name.find(".tif") != std::string::npos ? tiff({samples}) : grey_png(4, samples)});
  }
  ImportOptions options = kSpaced;
  options.member = member;
  return import_bytes(zip(members), {}, options);
}

TEST(Images, OfOtherNamesAreOtherVolumes) {
  const std::vector<std::string> two = {"1/img_001.png", "1/img_002.png", "1/mask_001.png",
                                        "1/mask_002.png", "1/legend.png"};
  const Outcome unchosen = import_pictures(two);
  ASSERT_EQ(unchosen.remedy.choices.size(), 2);
  EXPECT_EQ(unchosen.remedy.choices[1].value, "1/mask_*.png");
  const Outcome chosen = imported(import_pictures(two, "1/mask_*.png"));
  EXPECT_EQ(chosen.sample_bytes(), std::string(12, 'c') + std::string(12, 'd'));
  ASSERT_EQ(chosen.volume.ignored.size(), 1);
  EXPECT_EQ(chosen.volume.ignored[0].name, "legend.png");
  // A missing one is noticed in each group, and beside a picture without a number.
  EXPECT_THAT(import_pictures({"img_1.png", "img_2.png", "img_4.png", "mask_1.png", "mask_2.png"},
                              "img_*.png")
                  .error,
              HasSubstr("img_3.png"));
  EXPECT_THAT(import_pictures({"s1.png", "s2.png", "s4.png", "mip.png"}).error,
              HasSubstr("s3.png"));
  const Outcome preview =
      imported(import_pictures({"X3_rec_spr.png", "X3_rec01.png", "X3_rec02.png", "X3_rec03.png"}));
  EXPECT_EQ(preview.volume.dims, (Dims{4, 3, 3}));
  EXPECT_THAT(preview.volume.ignored[0].reason, HasSubstr("numbered images"));
}

TEST(Images, OfOneFolderAreOneVolumeInDoubt) {
  using Names = std::vector<std::string>;
  Names hexadecimal;
  for (const char sixteens : {'0', '1'}) {
    for (const char ones : std::string("0123456789abcdef")) {
      hexadecimal.push_back(std::string({sixteens, ones}) + ".png");
    }
  }
  for (const Names& names :
       {Names(hexadecimal.begin(), hexadecimal.begin() + 11),
        hexadecimal,
        {"0.png", "1.png", "2.png", "3.png", "4.png", "5.png", "6.png", "7.png", "8.png", "9.png",
         "a.png", "b.png", "c.png", "d.png", "e.png", "f.png"},
        {"q1.png", "q2.png", "w.png", "x.png", "y.png", "z.png"},
        {"Scan-001 (copy).png", "Scan-002.png", "Scan-003.png"},
        {"Scan-001 (copy).png", "Scan-002.png", "Scan-003.png", "Scan-004.png", "Scan-005.png"},
        {"img_001.tif", "img_002.tif", "img_003.tiff", "img_004.tif"},
        {"post_001.png", "post_002.png", "pre_003.png", "pre_004.png"},
        {"s.png", "s_2.png", "s_3.png", "s_4.png"},
        {"slice_0_8f.png", "slice_1_1b.png", "slice_2_7f.png", "slice_3_2b.png"},
        {"bottom.png", "top.png"}}) {
    const Outcome outcome = import_pictures(names);
    ASSERT_EQ(outcome.error, "") << names.front();
    std::string expected;
    for (std::size_t at = 0; at < names.size(); ++at) {
      expected += std::string(12, static_cast<char>('a' + at));
    }
    EXPECT_EQ(outcome.sample_bytes(), expected) << names.front();
    EXPECT_TRUE(outcome.volume.ignored.empty());
  }
}

TEST(Images, OfOneChannelMakeAVolume) {
  const auto of = [](const std::vector<std::string>& names, const std::string& description) {
    std::vector<Member> members;
    for (const std::string& name : names) members.push_back({name, tiff({kFirst}, description)});
    return import_bytes(zip(members), {}, kSpaced).error;
  };
  const std::string ome =
      "<OME><Image><Pixels DimensionOrder='XYZCT' SizeZ='2' SizeC='2'/></Image></OME>";
  EXPECT_THAT(of({"1.tif", "2.tif", "3.tif", "4.tif"}, ome),
              HasSubstr("2 slices, 2 channels and 1 times, but there are 4 files"));
  EXPECT_EQ(of({"1.tif", "2.tif"}, ome), "");
  const std::string range =
      "<OME><Image><Pixels DimensionOrder='XYZCT' SizeZ='9' SizeC='2'/></Image></OME>";
  EXPECT_EQ(of({"3.tif", "4.tif"}, range), "");
  EXPECT_THAT(of({"z0_c0.tif", "z0_c1.tif", "z1_c0.tif", "z1_c1.tif"}, ""),
              HasSubstr("a folder of their own"));
}

TEST(Images, MayBeCompressed) {
  const auto pair = [](const std::string& first, const std::string& second) {
    return import_bytes(zip({{"1.gz", gzip(first)}, {"2.gz", gzip(second)}}), {}, kSpaced);
  };
  EXPECT_EQ(pair(tiff({kFirst}), tiff({kSecond})).sample_bytes(), kSamples);
  EXPECT_EQ(pair(grey_png(4, kFirst), grey_png(4, kSecond)).sample_bytes(), kSamples);
  EXPECT_THAT(pair(tiff({kFirst, kFirst}), tiff({kSecond})).error, HasSubstr("several pages"));
  EXPECT_EQ(
      import_bytes(zip({{"a.gz", gzip(tiff({kFirst, kSecond}))}}), {}, kSpaced).sample_bytes(),
      kSamples);
}

TEST(Images, FoldersAreChosenAndPicturesBesideAVolumeIgnored) {
  const std::string image = grey_png(4, kFirst);
  const std::string two = zip({{"a/1.png", image},
                               {"a/2.png", image},
                               {"b/1.png", image},
                               {"b/2.png", grey_png(4, kSecond)}});
  ASSERT_EQ(import_bytes(two).remedy.choices.size(), 2);
  EXPECT_EQ(import_bytes(two).remedy.choices[1].value, "b/*.png");
  ImportOptions second = kSpaced;
  second.member = "b/*.png";
  EXPECT_EQ(import_bytes(two, {}, second).sample_bytes(), kSamples);
  const Outcome beside = imported(
      import_bytes(zip({{"1.png", image}, {"2.png", image}, {"a.nii", nifti({}, kSamples)}})));
  EXPECT_EQ(beside.volume.format, "nifti");
  EXPECT_EQ(beside.volume.ignored.size(), 2);
}

TEST(Images, EveryTruncationIsRefused) {
  const std::string last = grey_png(4, kSecond);
  constexpr std::size_t kEnd = 12;  // the chunk that ends the file holds nothing
  for (std::size_t size = 0; size + kEnd < last.size(); ++size) {
    const Outcome outcome = import_bytes(
        zip({{"1.png", grey_png(4, kFirst)}, {"2.png", last.substr(0, size) + " "}}), {}, kSpaced);
    EXPECT_FALSE(outcome.imported()) << size;
  }
  const std::string bitmap = grey_bmp(4, kSecond);
  for (std::size_t size = bitmap.size() - 13; size < bitmap.size(); ++size) {
    EXPECT_FALSE(
        import_bytes(zip({{"1", grey_bmp(4, kFirst)}, {"2", bitmap.substr(0, size)}}), {}, kSpaced)
            .imported());
  }
}

TEST(Images, SizesBeyondTheLimitsAreRefusedEarly) {
  std::string huge = grey_png(4, kFirst);
  huge.replace(16, 8, std::string("\0\x0f\0\0\0\x0f\0\0", 8));
  EXPECT_EQ(
      import_bytes(zip({{"1", huge}, {"2", huge}}), {.max_sample_bytes = 1 << 20}, kSpaced).code,
      ErrorCode::kTooLarge);
}

}  // namespace
}  // namespace isomesh::import::test
