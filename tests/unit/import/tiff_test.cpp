// The meaning of a TIFF's pages: which slice, channel or time each is, and where its rows begin.
#include "server/import/images/tiff.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/images/tiff_meaning.h"
#include "tests/support/errors.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;
using Vector = std::array<double, 3>;

const ImportOptions kSpaced = {.spacing = Vector{1, 1, 1}};

ImportOptions of_volume(std::uint64_t volume) {
  ImportOptions options = kSpaced;
  options.volume = volume;
  return options;
}

// A page of one value for each letter.
std::vector<std::string> pages_of(std::string_view letters) {
  std::vector<std::string> pages;
  for (const char letter : letters) pages.emplace_back(12, letter);
  return pages;
}

// The letters of the slices, or the error.
std::string slices_of(const Outcome& outcome) {
  if (!outcome.imported()) return outcome.error;
  std::string letters;
  for (std::size_t at = 0; at < outcome.sample_bytes().size(); at += 12) {
    letters += outcome.sample_bytes()[at];
  }
  return letters;
}

std::string slices_of(std::string_view letters, const std::string& description,
                      const ImportOptions& options = kSpaced) {
  return slices_of(import_bytes(tiff(pages_of(letters), description), {}, options));
}

std::string ome(const std::string& sizes, const std::string& data) {
  return "<?xml version='1.0'?><OME UUID='urn:uuid:1'><Image><Pixels DimensionOrder='XYZCT' " +
         sizes + ">" + data + "</Pixels></Image></OME>";
}

TEST(OmeTiff, TiffDataPlacesPages) {
  std::string shuffled;
  const int pages[] = {3, 0, 5, 1, 4, 2};
  for (int slice = 0; slice < 6; ++slice) {
    shuffled += "<TiffData IFD='" + std::to_string(pages[slice]) + "' FirstZ='" +
                std::to_string(slice) + "'/>";
  }
  EXPECT_EQ(slices_of("abcdef", ome("SizeZ='6'", shuffled)), "dafbec");
}

TEST(OmeTiff, TiffDataMayStandForSeveralPages) {
  const std::string sizes = "SizeZ='2' SizeC='2'";
  EXPECT_EQ(slices_of("abcd", ome(sizes, "<TiffData/>"), of_volume(1)), "cd");
  // Further pages belong to nothing.
  EXPECT_EQ(slices_of("abcdef", ome(sizes, "<TiffData/>"), of_volume(1)), "cd");
  EXPECT_EQ(slices_of("abcdef", ome(sizes, ""), of_volume(1)), "cd");
  EXPECT_EQ(slices_of("abcdef", ome(sizes, "<TiffData IFD='2' PlaneCount='4'/>"), of_volume(0)),
            "cd");
  const std::string by_channel =
      "<TiffData IFD='4' FirstC='0' PlaneCount='2'/><TiffData IFD='1' FirstC='1' NumPlanes='2'/>";
  EXPECT_EQ(slices_of("abcdef", ome(sizes, by_channel), of_volume(0)), "ef");
  EXPECT_EQ(slices_of("abcdef", ome(sizes, by_channel), of_volume(1)), "bc");
  EXPECT_THAT(slices_of("abcdef", ome(sizes, "<TiffData PlaneCount='3'/>"), of_volume(1)),
              HasSubstr("Slice 1 of the volume is not in this file"));
  EXPECT_THAT(slices_of("abc", ome(sizes, "<TiffData/>"), of_volume(1)),
              HasSubstr("Slice 1 of the volume is not in this file"));
}

TEST(OmeTiff, AFileOfASetHasItsOwnVolumes) {
  const auto channel = [](int number, int file) {
    const std::string data = "<TiffData IFD='0' PlaneCount='2' FirstC='" + std::to_string(number) +
                             "'><UUID FileName='" + std::to_string(file) +
                             ".ome.tif'>\nurn:uuid:" + std::to_string(file) +
                             "\n</UUID></TiffData>";
    return data;
  };
  const std::string sizes = "SizeZ='2' SizeC='3'";
  EXPECT_EQ(slices_of("ab", ome(sizes, channel(0, 2) + channel(1, 1) + channel(2, 3))), "ab");
  EXPECT_THAT(slices_of("ab", ome(sizes, channel(0, 2) + channel(1, 3))),
              HasSubstr("they are in other files"));
  // A single file that was given another identifier.
  EXPECT_EQ(slices_of("ab", ome(sizes, channel(1, 2))), "ab");
  const std::string one_of_each =
      "<TiffData IFD='0'><UUID>urn:uuid:1</UUID></TiffData>"
      "<TiffData IFD='0' FirstZ='1'><UUID>urn:uuid:2</UUID></TiffData>";
  EXPECT_THAT(slices_of("ab", ome("SizeZ='2'", one_of_each)),
              HasSubstr("each must have all slices of a volume"));
}

TEST(OmeTiff, SeveralImagesAreRefused) {
  const auto image = [](int page) {
    return "<Image><Pixels DimensionOrder='XYZCT' SizeZ='2'><TiffData PlaneCount='2' IFD='" +
           std::to_string(page) + "'/></Pixels></Image>";
  };
  EXPECT_THAT(slices_of("abcd", "<OME>" + image(0) + image(2) + "</OME>"),
              HasSubstr("holds several images"));
  EXPECT_THAT(slices_of("ab", "<OME><Pixels>"), HasSubstr("description is damaged"));
}

TEST(OmeTiff, ImagesMayBeInOtherFiles) {
  const auto image = [](const std::string& file) {
    const std::string uuid = "<UUID>" + file + "</UUID>";
    return "<Image><Pixels DimensionOrder='XYZCT' SizeZ='2'><TiffData IFD='1'>" + uuid +
           "</TiffData><TiffData IFD='0' FirstZ='1'>" + uuid + "</TiffData></Pixels></Image>";
  };
  const std::string both = image("A") + image("B") + "</OME>";
  EXPECT_EQ(slices_of("ab", "<OME UUID='A'>" + both), "ba");
  EXPECT_EQ(slices_of("ab", "<OME UUID='B'>" + both), "ba");
  EXPECT_EQ(slices_of("ab", "<OME>" + both), "ba");
  EXPECT_THAT(slices_of("abc", "<OME>" + both), HasSubstr("they are in other files"));
  EXPECT_THAT(slices_of("ab", "<OME>" + image("A") + image("A") + "</OME>"),
              HasSubstr("holds several images"));
}

TEST(OmeTiff, TheFirstOfImagesWithoutTiffDataMayHaveAllPages) {
  const std::string images =
      "<OME><Image><Pixels DimensionOrder='XYZCT' SizeZ='3'/></Image>"
      "<Image><Pixels DimensionOrder='XYZCT' SizeZ='1'/></Image></OME>";
  EXPECT_EQ(slices_of("abc", images), "abc");
  EXPECT_THAT(slices_of("abcd", images), HasSubstr("holds several images"));
}

TEST(OmeTiff, FaultsBesideTheImageTakeNothingFromIt) {
  const std::string data = "<TiffData IFD='1'/><TiffData IFD='0' FirstZ='1'/>";
  const std::string pixels =
      "<Pixels DimensionOrder='XYZCT' SizeZ='2'>" + data + "</Pixels></Image>";
  const std::string element = "<OME><Image>" + pixels + "</OME>";
  for (const std::string& description :
       {"\xef\xbb\xbf<?xml version='1.0' encoding='utf-8'?>" + element,
        "written by a program <?xml version='1.0'?>" + element,
        "<?xml version='1.0' encoding='UTF-16'?>\n<!-- OME-XML -->\n" + element,
        "<?xml version='1.0' encoding='windows-1252'?>" + element, element + "\n</OME> text",
        "<OME><Image Name='a & b &amp; c'>" + pixels + "</OME>",
        "<OME><Image Name='a&b;\x01&#x1;'>" + pixels + "</OME>",
        "<OME><Image>" + pixels + "<Note><</Note></OME>"}) {
    EXPECT_EQ(slices_of("ab", description), "ba") << description;
  }
  const std::string unit =
      "SizeZ='2' PhysicalSizeX='1000' PhysicalSizeY='1000' PhysicalSizeZ='1000' Note='a & b' "
      "PhysicalSizeXUnit='\xc2\xb5m' PhysicalSizeYUnit='&#xB5;m'";
  EXPECT_EQ(tiff_meaning(ome(unit, data), {}, 2).spacing, (Vector{1, 1, 1}));
  EXPECT_THAT(slices_of("abcd", "<OME><Image>" + pixels + "<Image Name='<'>" + pixels + "</OME>"),
              HasSubstr("description is damaged"));
}

// Maps of the pages of all of them would need gigabytes.
TEST(OmeTiff, ManyImagesAreRefusedAtTheSecond) {
  std::string images;
  for (int image = 0; image < 2000; ++image) {
    images += "<Pixels DimensionOrder='XYZCT' SizeZ='1000000'><TiffData/></Pixels>";
  }
  const auto error =
      isomesh::test::thrown_by([&] { tiff_meaning("<OME>" + images + "</OME>", {}, 20'000); });
  ASSERT_TRUE(error);
  EXPECT_THAT(error->what(), HasSubstr("several images"));
}

TEST(OmeTiff, UnitsMayBeEncodedInAnyWay) {
  for (const char* unit : {"&#181;m", "&#xB5;m", "\xc2\xb5m", "\xb5m"}) {
    const std::string attributes =
        "SizeZ='2' PhysicalSizeX='1000' PhysicalSizeY='2000' PhysicalSizeZ='3000' "
        "PhysicalSizeXUnit='" +
        std::string(unit) + "'";
    EXPECT_EQ(tiff_meaning(ome(attributes, "<TiffData/>"), {}, 2).spacing, (Vector{1, 2, 3}))
        << unit;
  }
  const std::string prefixed =
      "<ome:OME xmlns:ome='x'><ome:Image><ome:Pixels DimensionOrder='XYCZT' SizeZ='2' SizeC='2' "
      "PhysicalSizeX='1e7' PhysicalSizeY='1e7' PhysicalSizeZ='1e7' PhysicalSizeXUnit='\xc3\x85' "
      "PhysicalSizeYUnit='\xc3\x85' PhysicalSizeZUnit='\xc3\x85'><ome:TiffData IFD='0' "
      "PlaneCount='4'/></ome:Pixels></ome:Image></ome:OME>";
  const TiffMeaning meaning = tiff_meaning(prefixed, {}, 4);
  ASSERT_TRUE(meaning.spacing);
  EXPECT_NEAR((*meaning.spacing)[0], 1, 1e-12);
  EXPECT_EQ(meaning.page_of(1, 1), 3);
}

TEST(ImageJTiff, SpacingMayBeNegativeAndInInches) {
  EXPECT_EQ(tiff_meaning("ImageJ=1.53t\nimages=2\nslices=2\nunit=inch\nspacing=-2.0\n", {2, 1}, 2)
                .spacing,
            (Vector{12.7, 25.4, 50.8}));
}

TEST(ImageJTiff, PlanesMayFollowASinglePage) {
  const std::string planes = std::string(12, 'a') + std::string(12, 'b') + std::string(12, 'c');
  const std::string description = "ImageJ=1.53t\nimages=3\nslices=3\n";
  EXPECT_EQ(slices_of(import_bytes(tiff({planes}, description), {}, kSpaced)), "abc");
  EXPECT_EQ(slices_of(import_bytes(zip({{"a.tif", tiff({planes}, description)}}), {}, kSpaced)),
            "abc");
  const std::string channels = "ImageJ=1.53t\nimages=3\nchannels=3\nslices=1\n";
  EXPECT_THAT(slices_of(import_bytes(tiff({planes}, channels), {}, kSpaced)), HasSubstr("1 slice"));
  // The file ends in the last plane, or says nothing of planes.
  EXPECT_THAT(slices_of(import_bytes(tiff({planes}, "ImageJ=1.53t\nimages=300\nslices=300\n"), {},
                                     kSpaced)),
              HasSubstr("300 slices, 1 channels and 1 times, but the file has 1 page."));
  EXPECT_THAT(slices_of(import_bytes(tiff({planes}, "images=3\nslices=3\n"), {}, kSpaced)),
              HasSubstr("1 slice"));
}

TEST(TifffileTiff, NamesOfAxesSeparateVolumes) {
  const std::string axes = R"("axes": "TZYX", "shape": [2, 3, 3, 4]})";
  EXPECT_EQ(slices_of("abcdef", "{" + axes, of_volume(1)), "def");
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [3, 2, 3, 4], "axes": "ZCYX"})", of_volume(1)), "bdf");
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [1, 6, 3, 4, 1], "axes": "TQYXS"})"), "abcdef");
  EXPECT_THAT(slices_of("abcdef", R"({"shape": [6, 3, 4], "axes": "TYX"})"), HasSubstr("1 slice"));
}

TEST(TifffileTiff, OnlyAShapeOfThreeAxesIsClear) {
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [6, 3, 4]})"), "abcdef");
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [1, 6, 3, 4]})"), "abcdef");
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [3, 4]})"), "abcdef");     // written one by one
  EXPECT_EQ(slices_of("abcdef", R"({"shape": [2, 3, 4]})"), "abcdef");  // written in three parts
  EXPECT_EQ(slices_of("abcdef", R"({"name": "a scan"})"), "abcdef");
  EXPECT_EQ(tiff_meaning("{" + std::string(1 << 20, '['), {}, 6).slices, 6);
  EXPECT_THAT(slices_of("abcdef", R"({"shape": [2, 3, 3, 4]})"),
              HasSubstr("does not say which of them counts slices"));
  EXPECT_THAT(slices_of("abcdef", R"({"shape": [2, 3, 3, 4], "axes": "QZYX"})"),
              HasSubstr("does not say which of them counts slices"));
}

TEST(TifffileTiff, PlanesMayFollowASinglePage) {
  const std::string planes = std::string(12, 'a') + std::string(12, 'b') + std::string(12, 'c');
  const auto read = [&](const std::string& description) {
    return slices_of(import_bytes(tiff({planes}, description), {}, kSpaced));
  };
  EXPECT_EQ(read(R"({"shape": [3, 3, 4], "truncated": true})"), "abc");
  EXPECT_EQ(read(R"({"shape": [3, 1, 3, 4], "axes": "ZCYX", "truncated": true})"), "abc");
  EXPECT_THAT(read(R"({"shape": [300, 3, 4], "axes": "ZYX", "truncated": true})"),
              HasSubstr("300 slices, 1 channels and 1 times, but the file has 1 page."));
  EXPECT_THAT(read(R"({"shape": [3, 3, 4], "truncated": false})"), HasSubstr("1 slice"));
}

TEST(LsmTiff, TimesAreVolumes) {
  const auto lsm = [](std::int32_t slices, std::int32_t times, std::uint16_t scan) {
    std::string bytes =
        bytes_of(std::vector<std::int32_t>{0x0400494C, 512, 4, 3, slices, 1, times, 1, 0, 0}) +
        bytes_of(std::vector<double>{1e-6, 2e-6, 5e-6, 0, 0, 0}) +
        bytes_of(std::vector<std::uint16_t>{scan});
    bytes.resize(512);
    return bytes;
  };
  const auto read = [](const std::string& information, const ImportOptions& options) {
    return import_bytes(tiff(pages_of("abcdef"), {}, 1, {34412, information}), {}, options);
  };
  ImportOptions second;
  second.volume = 1;
  const Outcome outcome = read(lsm(2, 3, 6), second);
  EXPECT_EQ(slices_of(outcome), "cd");
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{0.001, 0.002, 0.005}));
  EXPECT_EQ(slices_of(read(lsm(6, 1, 2), {})), "abcdef");
  EXPECT_THAT(slices_of(read(lsm(2, 3, 3), second)), HasSubstr("scan of type 3"));
  EXPECT_THAT(slices_of(read(lsm(2, 2, 0), second)), HasSubstr("but the file has 6 pages"));
  EXPECT_EQ(slices_of(read(lsm(2, 3, 6).substr(0, 88), kSpaced)), "abcdef");
  EXPECT_EQ(slices_of(read(std::string(512, '\0'), kSpaced)), "abcdef");
}

TEST(ScifioTiff, AxesSeparateVolumes) {
  const std::string axes = "SCIFIO=0.41.0\naxes=X,Y,Channel,Z\nlengths=4,3,2,3\n";
  const std::string scales = "scales=500,500,1.0,2\nunits=micron,um,null,mm\n";
  EXPECT_EQ(slices_of("abcdef", axes, of_volume(1)), "bdf");
  EXPECT_EQ(tiff_meaning(axes + scales, {}, 6).spacing, (Vector{0.5, 0.5, 2}));
  EXPECT_FALSE(
      tiff_meaning(axes + "scales=1.0,1.0,1.0,1.0\nunits=null,null,null,null\n", {}, 6).spacing);
  EXPECT_THAT(slices_of("abcdef", "SCIFIO=1\naxes=X,Y,Lifetime,Z\nlengths=4,3,2,3\n"),
              HasSubstr("does not say which of them counts slices"));
}

TEST(Tiff, PagesOfSeveralPlanesAreRefused) {
  const auto with_depth = [](std::uint32_t depth) {
    return slices_of(import_bytes(
        tiff(pages_of("abc"), {}, 1, {32997, bytes_of(std::vector{depth})}), {}, kSpaced));
  };
  EXPECT_EQ(with_depth(1), "abc");
  EXPECT_THAT(with_depth(2), HasSubstr("several planes in a page"));
}

// Backwards too: a page is found by its place in the file, not by all pages before it.
TEST(Tiff, PagesMayBeReadInAnyOrder) {
  constexpr std::uint64_t kPages = 200;
  std::vector<std::string> pages;
  for (std::uint64_t at = 0; at < kPages; ++at) pages.emplace_back(12, static_cast<char>(at));
  const Folder folder;
  const InputFile input(folder.write("a.tif", test::tiff(pages)));
  TiffFile file(input);
  ASSERT_EQ(file.pages(), kPages);
  const auto read = [&](std::uint64_t page) {
    file.read(
        page, [](const PageLayout&) {},
        [&](std::span<const std::byte> samples) {
          EXPECT_EQ(static_cast<char>(samples[0]), static_cast<char>(page));
        });
  };
  for (std::uint64_t at = 0; at < kPages; ++at) read(at);
  for (std::uint64_t at = kPages; at-- > 0;) read(at);
}

TEST(Tiff, PagesBeginAtTheirTopLeft) {
  const std::string stored = "abcdefghijkl";
  const auto of = [&](int first, int second) {
    const auto bytes = [&](int orientation) { return tiff({stored}, {}, orientation); };
    return import_bytes(zip({{"1.tif", bytes(first)}, {"2.tif", bytes(second)}}), {}, kSpaced);
  };
  EXPECT_EQ(of(1, 4).sample_bytes(), stored + "ijklefghabcd");
  EXPECT_EQ(of(2, 3).sample_bytes(),
            "dcbahgfelkji"
            "lkjihgfedcba");
  EXPECT_THAT(of(1, 6).error, HasSubstr("orientation 6 exchanges rows and columns"));
  EXPECT_EQ(import_bytes(tiff({stored, stored}, {}, 4), {}, kSpaced).sample_bytes(),
            "ijklefghabcd"
            "ijklefghabcd");
  std::string different = tiff({stored, stored}, {}, 4);
  different[different.rfind(std::string("\x12\x01\3\0\1\0\0\0\4", 9)) + 8] = 1;
  EXPECT_THAT(import_bytes(different, {}, kSpaced).error, HasSubstr("differ in their orientation"));
}

}  // namespace
}  // namespace isomesh::import::test
