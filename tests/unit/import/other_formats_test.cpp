// Formats of microscopy, chemistry and research: what is read and what is refused.
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::Contains;
using testing::DoubleNear;
using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using Vector = std::array<double, 3>;
using Dims = std::array<std::uint32_t, 3>;

const std::string kSamples(kSmallSamples);
const ImportOptions kSpaced = {.spacing = Vector{1, 2, 3}};
constexpr std::array<double, 9> kIdentity = {1, 0, 0, 0, 1, 0, 0, 0, 1};

TEST(Mgh, LiesByItsCosinesAndCentre) {
  const Outcome outcome = imported(import_bytes(
      mgh({.spacing = {1, 2, 3}, .cosines = {-1, 0, 0, 0, 0, -1, 0, 1, 0}, .centre = {5, 6, 7}},
          kSamples)));
  EXPECT_EQ(outcome.volume.format, "mgh");
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{1, 2, 3}));
  // The centre is that of 4 x 3 x 2 steps: (5 + 2, 6 - 3, 7 + 3) in RAS.
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-7, -3, 10}));
}

TEST(Mgh, IsCoronalWithoutAxesAndSaysSo) {
  const Outcome outcome = import_bytes(mgh({.has_axes = 0}, kSamples));
  EXPECT_THAT(codes_of(outcome), Contains("space-assumed"));
  EXPECT_EQ(outcome.volume.geometry.direction,
            (std::array<double, 9>{1, 0, 0, 0, 0, -1, 0, -1, 0}));
}

TEST(Mgh, OneFrameIsChosenAndTagsBehindAreIgnored) {
  const std::string file = mgh({.sizes = {2, 3, 2, 2}}, kSamples + std::string(9000, 'x'));
  EXPECT_EQ(import_bytes(file).remedy.choices.size(), 2);
  EXPECT_EQ(import_bytes(file, {}, {.volume = 1}).sample_bytes(), kSamples.substr(12));
  const Outcome gzipped = import_bytes(gzip(file), {}, {.volume = 0});
  EXPECT_THAT(codes_of(gzipped), ElementsAre("volume-chosen"));
}

TEST(Mgh, ValuesOfASurfaceAreNoVolume) {
  EXPECT_THAT(import_bytes(mgh({.sizes = {2562, 1, 1, 1}}, std::string(2562, 'a'))).error,
              HasSubstr("a value for each vertex of a surface"));
}

TEST(NumPy, BothOrdersOfMemoryAreOneVolume) {
  const Outcome c = import_bytes(npy(npy_header("|u1", false, "(2, 3, 4)"), kSamples), {}, kSpaced);
  EXPECT_EQ(c.volume.dims, (Dims{4, 3, 2}));
  EXPECT_EQ(c.sample_bytes(), kSamples);
  EXPECT_THAT(codes_of(c), Contains("space-assumed"));
  std::string fortran;
  for (std::size_t x = 0; x < 4; ++x) {
    for (std::size_t y = 0; y < 3; ++y) {
      for (std::size_t z = 0; z < 2; ++z) fortran += kSamples[x + 4 * (y + 3 * z)];
    }
  }
  const Outcome f = import_bytes(npy(npy_header("|u1", true, "(2, 3, 4)"), fortran), {}, kSpaced);
  EXPECT_EQ(f.canonical, c.canonical);
  EXPECT_NE(f.canonical, "");
}

TEST(NumPy, OfTwoAxesIsAFlatImage) {
  EXPECT_THAT(import_bytes(npy(npy_header("|u1", false, "(6, 4)"), kSamples)).error,
              HasSubstr("flat image: it has 1 slice of 4 x 6 samples"));
}

TEST(NumPy, OneVolumeAlongTheFirstAxisIsChosenInBothOrders) {
  ImportOptions second = kSpaced;
  second.volume = 1;
  const std::string c = npy(npy_header("|u1", false, "(2, 2, 3, 2)"), kSamples);
  EXPECT_EQ(import_bytes(c, {}, second).sample_bytes(), kSamples.substr(12));
  const std::string f = npy(npy_header("|u1", true, "(2, 2, 3, 2)"), kSamples);
  // The first index runs fastest, then z, then y, then x.
  EXPECT_EQ(import_bytes(f, {}, second).sample_bytes(), "bnfrjvdphtlx");
}

TEST(NumPy, ReadsTypesInBothByteOrders) {
  const std::vector<std::int16_t> numbers = some_samples<std::int16_t>(24);
  for (const bool big : {false, true}) {
    const std::string header = npy_header(big ? ">i2" : "<i2", false, "(2, 3, 4)");
    const Outcome outcome = import_bytes(npy(header, bytes_of(numbers, big)), {}, kSpaced);
    EXPECT_EQ(samples_of<std::int16_t>(outcome), numbers);
  }
  // 1, -2, the smallest and the largest of 16 bits.
  const std::vector<std::uint16_t> halves = {0x3c00, 0xc000, 0x0001, 0x7bff, 0, 0, 0, 0};
  for (const bool big : {false, true}) {
    const std::string header = npy_header(big ? ">f2" : "<f2", false, "(2, 2, 2)");
    const Outcome outcome = import_bytes(npy(header, bytes_of(halves, big)), {}, kSpaced);
    EXPECT_THAT(samples_of<float>(outcome), ElementsAre(1, -2, 0x1p-24F, 65504, 0, 0, 0, 0));
    const Outcome cut = import_bytes(npy(header, bytes_of(halves, big).substr(1)), {}, kSpaced);
    EXPECT_THAT(cut.error, HasSubstr("truncated"));
  }
  EXPECT_THAT(import_bytes(npy(npy_header("|O", false, "(1,)"), "x")).error, HasSubstr("\"|O\""));
  EXPECT_THAT(import_bytes(npy(npy_header("<f8", false, "(3,)"), "x")).error,
              HasSubstr("shape (3)"));
}

TEST(NumPy, OtherArraysOfAnNpzAreIgnored) {
  const Outcome outcome =
      imported(import_bytes(zip({{"data.npy", npy(npy_header("|u1", false, "(2, 3, 4)"), kSamples)},
                                 {"spacing.npy", npy(npy_header("<f8", false, "(3,)"), "x")},
                                 {"properties.npy", npy(npy_header("|O", false, "()"), "x")}}),
                            {}, kSpaced));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
}

TEST(Mrc, IsInAngstromAndStartsWhereItsCellSays) {
  for (const bool big : {false, true}) {
    const Outcome outcome = imported(import_bytes(
        mrc({.big_endian = big, .start = {-2, 1, 0}, .cell = {8, 3, 2}, .extended = "more"},
            kSamples)));
    EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
    EXPECT_EQ(outcome.volume.type, SampleType::kInt8);
    EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{2, 1, 1}));
    EXPECT_EQ(outcome.volume.geometry.origin, (Vector{-4, 1, 0}));
    EXPECT_EQ(outcome.sample_bytes(), kSamples);
    EXPECT_THAT(codes_of(outcome), Contains("unit-angstrom"));
  }
  EXPECT_EQ(import_bytes(mrc({.start = {-2, 1, 0}, .origin = {5, 6, 7}}, kSamples))
                .volume.geometry.origin,
            (Vector{5, 6, 7}));
}

// Columns along z, rows along x, sections along y.
TEST(Mrc, AxesAreReordered) {
  const Outcome outcome = imported(
      import_bytes(mrc({.sizes = {2, 4, 3}, .start = {1, 0, 0}, .axes = {3, 1, 2}}, kSamples)));
  EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
  EXPECT_EQ(outcome.volume.geometry.direction, kIdentity);
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{0, 0, 1}));
  EXPECT_EQ(outcome.sample_bytes(), "acegikmoqsuwbdfhjlnprtvx");
}

TEST(Mrc, AnglesOfTheCellShearTheLattice) {
  const Geometry geometry = import_bytes(mrc({.angles = {90, 90, 120}}, kSamples)).volume.geometry;
  EXPECT_NEAR(geometry.direction[1], std::cos(2 * std::numbers::pi / 3), 1e-7);
  EXPECT_NEAR(geometry.direction[4], std::sin(2 * std::numbers::pi / 3), 1e-7);
  EXPECT_FALSE(import_bytes(mrc({.angles = {10, 10, 120}}, kSamples)).imported());
}

TEST(Mrc, StacksOfVolumesAreChosenAndThoseOfImagesRefused) {
  const std::string stack =
      mrc({.sizes = {2, 3, 4}, .sampling = {2, 3, 2}, .space_group = 401}, kSamples);
  EXPECT_EQ(import_bytes(stack, {}, {.volume = 1}).sample_bytes(), kSamples.substr(12));
  EXPECT_THAT(import_bytes(mrc({.sampling = {4, 3, 1}, .space_group = 0}, kSamples)).error,
              HasSubstr("a stack of 2 images"));
  EXPECT_THAT(import_bytes(mrc({.mode = 4}, kSamples)).error, HasSubstr("complex"));
}

std::string counted(int count) {
  std::string numbers;
  for (int at = 0; at < count; ++at) numbers += std::to_string(at) + (at % 6 == 5 ? "\n" : " ");
  return numbers + '\n';
}

TEST(Cube, TurnsBohrIntoAngstromAndTheLastAxisRunsFastest) {
  constexpr double kBohr = 0.529177210903;
  const Outcome outcome = imported(import_bytes(cube({.atoms = "1 1 2 3"}, counted(24))));
  EXPECT_EQ(outcome.volume.dims, (Dims{2, 3, 4}));
  const auto is_nearly = [](double place) { return DoubleNear(place, 1e-4 * kBohr); };
  EXPECT_THAT(outcome.volume.geometry.spacing, Each(is_nearly(kBohr)));
  EXPECT_THAT(outcome.volume.geometry.origin,
              ElementsAre(is_nearly(kBohr), is_nearly(2 * kBohr), is_nearly(3 * kBohr)));
  const std::vector<float> samples = samples_of<float>(outcome);
  EXPECT_EQ(samples[1], 12);  // one step along x
  EXPECT_EQ(samples[2], 4);   // one step along y
  EXPECT_EQ(samples[6], 1);   // one step along z
  const Outcome angstrom =
      import_bytes(cube({.axes = {"-2 1 0 0", "3 0 1 0", "4 0 0 1"}}, counted(24)));
  EXPECT_EQ(angstrom.volume.geometry.spacing, (Vector{1, 1, 1}));
}

TEST(Cube, OneOfSeveralValuesIsChosen) {
  for (const CubeFields& fields : {CubeFields{.atoms = "-1 0 0 0", .behind_atoms = "2 7\n 8\n"},
                                   CubeFields{.atoms = "1 0 0 0 2"}}) {
    const std::string file = cube(fields, counted(48));
    EXPECT_EQ(import_bytes(file).remedy.choices.size(), 2);
    const Outcome outcome = import_bytes(file, {}, {.volume = 1});
    EXPECT_EQ(outcome.volume.range, (std::array<double, 2>{1, 47}));
  }
  EXPECT_THAT(import_bytes(cube({}, counted(23))).error, HasSubstr("truncated"));
  EXPECT_FALSE(import_bytes(cube({.atoms = "900000 0 0 0"}, "")).imported());
  EXPECT_FALSE(
      import_bytes(cube({.atoms = "-1 0 0 0", .behind_atoms = "9999999\n"}, "")).imported());
}

TEST(VtkLegacy, ReadsPointsInTextAndBinary) {
  const std::string scalars = "SCALARS s unsigned_char 1\nLOOKUP_TABLE default\n";
  const Outcome binary =
      imported(import_bytes(vtk_legacy(false, "POINT_DATA 24\n" + scalars + kSamples)));
  EXPECT_EQ(binary.volume.format, "vtk");
  EXPECT_EQ(binary.volume.geometry.origin, (Vector{10, 20, 30}));
  EXPECT_EQ(binary.volume.geometry.spacing, (Vector{1, 2, 3}));
  EXPECT_EQ(binary.sample_bytes(), kSamples);
  const Outcome text = imported(
      import_bytes(vtk_legacy(true, "POINT_DATA 24\n" + scalars + counted(24) + "METADATA\n")));
  EXPECT_EQ(samples_of<std::uint8_t>(text)[23], 23);
}

TEST(VtkLegacy, KeywordsAndTypesMayBeInLowerCase) {
  const std::string scalars = "SCALARS s UNSIGNED_CHAR\nLOOKUP_TABLE default\n";
  const std::string expected =
      import_bytes(vtk_legacy(true, "POINT_DATA 24\n" + scalars + counted(24))).canonical;
  const std::string begin = "# vtk DataFile Version 3.0\nDATASET of a title\n";
  for (const std::string behind : {"", "metadata\n", "vectors v float\n", "field f 0\n"}) {
    const Outcome outcome =
        import_bytes(begin +
                     lower("ASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 4 3 2\nSPACING 1 2 3\n"
                           "ORIGIN 10 20 30\nPOINT_DATA 24\n" +
                           scalars) +
                     counted(24) + behind);
    ASSERT_EQ(outcome.error, "") << behind;
    EXPECT_EQ(outcome.canonical, expected) << behind;
  }
  const Member surface = {"a.vtk", begin + "ascii\ndataset polydata\n"};
  EXPECT_EQ(import_bytes(zip({surface, {"b.mha", metaimage(small_metaimage(), kSamples)}})).error,
            "");
}

TEST(VtkLegacy, AnExtentBeginsBehindTheOrigin) {
  std::string file = vtk_legacy(true, "POINT_DATA 24\nSCALARS s short\n" + counted(24));
  const std::string points = "DIMENSIONS 4 3 2";
  const auto with_extent = [&](const std::string& extent) {
    return import_bytes(std::string(file).replace(file.find(points), points.size(), extent));
  };
  const Outcome outcome = imported(with_extent("EXTENT 2 5 -1 1 0 1"));
  EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{12, 18, 30}));
  EXPECT_THAT(with_extent("EXTENT 2 5 1 0 0 1").error, HasSubstr("the first and last index"));
}

TEST(VtkLegacy, OneOfSeveralArraysIsChosen) {
  const auto array = [](const std::string& head) { return head + '\n' + counted(24); };
  const std::string mask = array("vtkGhostType 1 24 unsigned_char");
  const std::string density = array("density 1 24 short");
  const Outcome outcome =
      imported(import_bytes(vtk_legacy(true, "POINT_DATA 24\nFIELD f 2\n" + mask + density)));
  EXPECT_EQ(outcome.volume.type, SampleType::kInt16);
  const std::string two = vtk_legacy(
      true, "POINT_DATA 24\nFIELD f 3\n" + mask + density + array("heat 1 24 unsigned_short"));
  const Outcome refused = import_bytes(two);
  ASSERT_EQ(refused.remedy.choices.size(), 2);
  EXPECT_EQ(refused.remedy.choices[1].title, "array \"heat\"");
  EXPECT_EQ(import_bytes(two, {}, {.volume = 1}).volume.type, SampleType::kUint16);
}

// vtkStructuredPointsWriter writes bytes so.
TEST(VtkLegacy, ColoursInTextAreFractionsOf255) {
  const auto of = [](const std::string& last) {
    std::string data = "POINT_DATA 24\nCOLOR_SCALARS s 1\n";
    for (int at = 0; at < 23; ++at) data += std::to_string(at * 11 / 255.0) + ' ';
    return import_bytes(vtk_legacy(true, data + last + "\nMETADATA\nINFORMATION 0\n\n"));
  };
  const Outcome outcome = imported(of("1"));
  const auto samples = samples_of<std::uint8_t>(outcome);
  for (std::size_t at = 0; at < 23; ++at) EXPECT_EQ(samples[at], at * 11);
  EXPECT_EQ(samples[23], 255);
  EXPECT_THAT(of("1.01").error, HasSubstr("is not a number from 0 to 1"));
  EXPECT_THAT(of("nan").error, HasSubstr("is not a number from 0 to 1"));
  const std::string binary = "POINT_DATA 24\nCOLOR_SCALARS s 1\n" + kSamples;
  EXPECT_EQ(import_bytes(vtk_legacy(false, binary)).sample_bytes(), kSamples);
}

TEST(VtkLegacy, SkipsOtherArraysAndTakesCellsAlone) {
  const std::string scalars = "SCALARS s short\nLOOKUP_TABLE default\n";
  const std::string field = "FIELD f 1\nv 3 2 float\n" + std::string(24, '\n') + "\n";
  const std::vector<std::int16_t> points = some_samples<std::int16_t>(24);
  const Outcome both = imported(import_bytes(vtk_legacy(
      false, "CELL_DATA 6\n" + field + "POINT_DATA 24\n" + scalars + bytes_of(points, true))));
  EXPECT_EQ(samples_of<std::int16_t>(both), points);
  const Outcome cells =
      imported(import_bytes(vtk_legacy(true, "CELL_DATA 12\n" + scalars + counted(12), "4 3 3")));
  EXPECT_EQ(cells.volume.dims, (Dims{3, 2, 2}));
  EXPECT_EQ(cells.volume.geometry.origin, (Vector{10.5, 21, 31.5}));
}

TEST(VtkLegacy, RefusesWhatIsNoImage) {
  const auto of = [](const std::string& data) {
    return import_bytes(vtk_legacy(false, data)).error;
  };
  EXPECT_THAT(
      import_bytes("# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINT_DATA 1\n").error,
      HasSubstr("POLYDATA"));
  EXPECT_THAT(of("POINT_DATA 23\nSCALARS s char\n" + kSamples), HasSubstr("contradicts itself"));
  EXPECT_THAT(of("POINT_DATA 24\nSCALARS s char 3\nLOOKUP_TABLE t\n"), HasSubstr("3 components"));
  EXPECT_THAT(of("POINT_DATA 24\nSCALARS s char\n"), HasSubstr("truncated"));
  EXPECT_THAT(of("POINT_DATA 24\nFIELD f 1\na 4294967295 4294967295 double\n"),
              HasSubstr("damaged or truncated"));
}

TEST(Vti, CellsAloneLieAtTheirCentres) {
  std::string file = vti({.form = VtiForm::kBinary, .extent = "0 4 0 3 0 2"}, kSamples);
  const std::string points = "PointData";
  for (std::size_t at = file.find(points); at != file.npos; at = file.find(points, at)) {
    file.replace(at, points.size(), "CellData");
  }
  file.erase(file.find("<CellData/>"), 11);
  const Outcome outcome = imported(import_bytes(file));
  EXPECT_EQ(outcome.volume.dims, (Dims{4, 3, 2}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{0.5, 0.5, 0.5}));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
}

std::string afni(const std::vector<AfniAttribute>& attributes, const std::string& brick,
                 const std::string& suffix = ".BRIK") {
  return zip({{"a+orig.HEAD", afni_head(attributes)}, {"a+orig" + suffix, brick}});
}

TEST(Afni, LiesByItsAxesOrItsMatrix) {
  const std::vector<AfniAttribute> axes = {{"ORIENT_SPECIFIC", "integer", "4 0 3"},
                                           {"ORIGIN", "float", "1 2 3"},
                                           {"DELTA", "float", "4 5 -6"}};
  const Outcome outcome = imported(import_bytes(afni(axes, kSamples)));
  EXPECT_EQ(outcome.volume.format, "afni");
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{2, 3, 1}));
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{4, 5, 6}));
  EXPECT_EQ(outcome.volume.geometry.direction, (std::array<double, 9>{0, 1, 0, 0, 0, -1, 1, 0, 0}));
  const Outcome matrix =
      import_bytes(afni({{"IJK_TO_DICOM_REAL", "float", "2 0 0 7 0 2 0 8 0 0 2 9"}}, kSamples));
  EXPECT_EQ(matrix.volume.geometry, (Geometry{.origin = {7, 8, 9}, .spacing = {2, 2, 2}}));
}

TEST(Afni, ASubBrickIsChosenWithItsFactor) {
  const std::vector<AfniAttribute> two = {{"DATASET_DIMENSIONS", "integer", "2 3 2"},
                                          {"DATASET_RANK", "integer", "3 2"},
                                          {"BRICK_TYPES", "integer", "0 0"},
                                          {"BRICK_LABS", "string", "'before~after~"},
                                          {"BRICK_FLOAT_FACS", "float", "0 2"}};
  const Outcome refused = import_bytes(afni(two, kSamples));
  ASSERT_EQ(refused.remedy.choices.size(), 2);
  EXPECT_EQ(refused.remedy.choices[1].title, "sub-brick 1: after");
  for (const auto& [brick, suffix] : {std::pair{kSamples, ".BRIK"},
                                      {gzip(kSamples), ".BRIK.gz"},
                                      {bzip2(kSamples), ".BRIK.bz2"}}) {
    const Outcome second = import_bytes(afni(two, brick, suffix), {}, {.volume = 1});
    ASSERT_EQ(second.error, "") << suffix;
    EXPECT_EQ(samples_of<float>(second)[0], 'm' * 2.0F);
    EXPECT_EQ(import_bytes(afni(two, brick, suffix), {}, {.volume = 0}).sample_bytes(),
              kSamples.substr(0, 12));
  }
  EXPECT_THAT(import_bytes(afni_head()).error, HasSubstr(".BRIK file, which is missing"));
  EXPECT_FALSE(import_bytes(afni({}, kSamples.substr(1))).imported());
}

TEST(Isq, HasMicrometresAndStoredSamples) {
  const std::vector<std::int16_t> numbers = some_samples<std::int16_t>(24);
  const Outcome outcome = imported(import_bytes(isq({.blocks = 2}, bytes_of(numbers))));
  EXPECT_EQ(samples_of<std::int16_t>(outcome), numbers);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{0.01, 0.02, 0.03}));
  EXPECT_EQ(outcome.volume.geometry.origin, (Vector{0, 0, 1.5}));
  EXPECT_FALSE(import_bytes(isq({.type = 4}, bytes_of(numbers))).imported());
  EXPECT_FALSE(import_bytes(isq({.samples = {-1, 3, 2}}, bytes_of(numbers))).imported());
  EXPECT_FALSE(import_bytes(isq({.blocks = INT32_MAX}, bytes_of(numbers))).imported());
}

std::string par_rec(const std::vector<ParImage>& images, const std::string& samples) {
  return zip({{"a.PAR", par(images)}, {"a.REC", samples}});
}

TEST(ParRec, SlicesAreFoundByTheirPlace) {
  const Outcome outcome = imported(import_bytes(par_rec(
      {{.slice = 1, .place = 1, .slope = 2}, {.slice = 2, .place = 0, .slope = 2}}, kSamples)));
  EXPECT_EQ(outcome.volume.format, "par");
  EXPECT_EQ(samples_of<float>(outcome)[0], 'm' * 2.0F);
  EXPECT_EQ(outcome.volume.geometry.spacing, (Vector{1.5, 1.25, 3}));
}

TEST(ParRec, EachSliceHasItsOwnScale) {
  const Outcome outcome = imported(import_bytes(par_rec(
      {{.slice = 1, .place = 1, .slope = 2}, {.slice = 2, .place = 0, .slope = 0.5}}, kSamples)));
  EXPECT_EQ(samples_of<float>(outcome)[0], 'm' * 2.0F);
  EXPECT_EQ(samples_of<float>(outcome)[23], 'l' * 0.5F);
}

// They do not tell the weights of diffusion.
TEST(ParRec, RepeatedSlicesOfVersion4AreVolumes) {
  std::string header = par({{.slice = 1, .place = 0},
                            {.slice = 2, .place = 1},
                            {.slice = 1, .place = 2},
                            {.slice = 2, .place = 3}});
  const std::string second(kSamples.rbegin(), kSamples.rend());
  const auto read = [&](const ImportOptions& options) {
    return import_bytes(zip({{"a.PAR", header}, {"a.REC", kSamples + second}}), {}, options);
  };
  EXPECT_THAT(read({}).error, HasSubstr("there twice"));
  const std::string later = " 1 1 7 0 0 0 0 1\n";  // the columns of 4.1 and 4.2
  for (std::size_t at = header.find(later); at != header.npos; at = header.find(later)) {
    header.replace(at, later.size(), "\n");
  }
  const Outcome refused = read({});
  ASSERT_EQ(refused.remedy.choices.size(), 2);
  EXPECT_EQ(refused.remedy.choices[1].title, "repetition 2");
  EXPECT_EQ(read({.volume = 1}).sample_bytes(), second);
}

TEST(ParRec, AnInstantIsChosenAndMissingSlicesAreNamed) {
  const std::vector<ParImage> two = {{.slice = 1, .instant = 1, .place = 0},
                                     {.slice = 2, .instant = 1, .place = 1},
                                     {.slice = 1, .instant = 2, .place = 2},
                                     {.slice = 2, .instant = 2, .place = 3}};
  const std::string second(kSamples.rbegin(), kSamples.rend());
  const Outcome refused = import_bytes(par_rec(two, kSamples + second));
  ASSERT_EQ(refused.remedy.choices.size(), 2);
  EXPECT_EQ(refused.remedy.choices[1].title, "instant 2");
  EXPECT_EQ(import_bytes(par_rec(two, kSamples + second), {}, {.volume = 1}).sample_bytes(),
            second);
  EXPECT_THAT(import_bytes(par_rec({{.slice = 1}, {.slice = 3, .place = 1}}, kSamples)).error,
              HasSubstr("Slice 2 of 2"));
  EXPECT_THAT(import_bytes(par_rec({{.slice = 1}, {.slice = 2, .place = 2}}, kSamples)).error,
              HasSubstr("image 2 is missing"));
}

TEST(ParRec, TheFirstOfSeveralLargeVolumesIsRead) {
  constexpr int kFarBehind = 200'000;  // images, more than the bound of a file has as headroom
  const std::string samples = kSamples + std::string(std::size_t{12} * kFarBehind, 'x');
  const Outcome outcome =
      imported(import_bytes(par_rec({{.slice = 1, .instant = 1, .place = 0},
                                     {.slice = 2, .instant = 1, .place = 1},
                                     {.slice = 1, .instant = 2, .place = kFarBehind},
                                     {.slice = 2, .instant = 2, .place = kFarBehind + 1}},
                                    samples),
                            {}, {.volume = 0}));
  EXPECT_EQ(outcome.sample_bytes(), kSamples);
}

}  // namespace
}  // namespace isomesh::import::test
