// RT structure sets: contours drawn on the grid of their images, or on one of their own.
#include <algorithm>
#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/dicom/contours/raster.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/structures.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// Twenty by sixteen samples of 1 mm in eight slices 2 mm apart, from (0, 0, 0).
const DicomSeries kImages = {.columns = 20,
                             .rows = 16,
                             .slices = 8,
                             .origin = {0, 0, 0},
                             .step = {0, 0, 2},
                             .between_rows = 1,
                             .between_columns = 1};

NamedFiles with_images(const DicomObject& structures, const DicomSeries& images = kImages) {
  NamedFiles files = changed(
      images, [](DicomObject& object) { object.text(kFrameOfReferenceUid, "UI", "1.2.3.frame"); });
  files.emplace_back("RS", structures.file(kImplicit));
  return files;
}

Outcome draw(const std::vector<TestStructure>& structures) {
  return import_objects(with_images(structure_set(structures)), {.series = "1.2.9"});
}

Outcome draw_alone(const DicomObject& structures, const std::array<double, 3>& spacing) {
  return import_objects({{"RS", structures.file(kImplicit)}}, {.spacing = spacing});
}

// Even-odd, by rays along columns; our raster follows rows.
bool is_inside(const std::vector<Points>& contours, double x, double y) {
  bool inside = false;
  for (const Points& points : contours) {
    for (std::size_t at = 0; at < points.size(); ++at) {
      const Vector3& a = points[at];
      const Vector3& b = points[(at + 1) % points.size()];
      if ((a[0] > x) == (b[0] > x)) continue;
      if (a[1] + (x - a[0]) / (b[0] - a[0]) * (b[1] - a[1]) > y) inside = !inside;
    }
  }
  return inside;
}

unsigned sample(const Outcome& outcome, std::uint32_t i, std::uint32_t j, std::uint32_t k) {
  const auto& dims = outcome.volume.dims;
  return static_cast<unsigned char>(
      outcome.sample_bytes()[(std::size_t{k} * dims[1] + j) * dims[0] + i]);
}

void expect_drawn(const Outcome& outcome, const std::vector<Points>& contours, std::uint32_t k) {
  ASSERT_EQ(outcome.error, "");
  for (std::uint32_t j = 0; j < 16; ++j) {
    for (std::uint32_t i = 0; i < 20; ++i) {
      ASSERT_EQ(sample(outcome, i, j, k) != 0, is_inside(contours, i, j))
          << i << ' ' << j << ' ' << k;
    }
  }
}

TEST(DicomStructures, AreDrawnOnTheGridOfTheirImages) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> x(-3, 23);
  std::uniform_real_distribution<double> y(-3, 19);
  for (int round = 0; round < 20; ++round) {
    // Edges may cross one another, and the border of the images.
    Points points;
    for (int at = 0; at < 9; ++at) points.push_back({x(random), y(random), 6});
    const Outcome outcome = draw({{.name = "body", .contours = {{points}}}});
    for (std::uint32_t k = 0; k < 8; ++k) {
      expect_drawn(outcome, std::vector<Points>(k == 3 ? 1 : 0, points), k);
    }
  }
}

TEST(DicomStructures, HaveNamesInTheCharacterSetOfTheFile) {
  DicomObject object = structure_set({{.name = "H\xfc"
                                               "fte",
                                       .contours = {{box(1.5, 1.5, 6.5, 6.5, 4)}}}});
  object.text(kSpecificCharacterSet, "CS", "ISO_IR 100");
  const Outcome outcome = imported(import_objects(with_images(object), {.series = "1.2.9"}));
  ASSERT_EQ(outcome.volume.labels.size(), 1);
  EXPECT_EQ(outcome.volume.labels[0].name, "Hüfte");
}

TEST(DicomStructures, HaveTheGeometryNamesAndColoursOfTheirFiles) {
  const Outcome outcome =
      imported(draw({{.number = 5, .name = "heart", .contours = {{box(1.5, 1.5, 6.5, 6.5, 4)}}},
                     {.number = 9,
                      .name = "lung",
                      .contours = {{box(8.5, 1.5, 12.5, 6.5, 4)}},
                      .color = "0\\128\\255"}}));
  const Outcome images =
      imported(import_objects(with_images(structure_set({})), {.series = "1.2.3.4"}));
  EXPECT_EQ(outcome.volume.dims, images.volume.dims);
  EXPECT_EQ(outcome.volume.geometry, images.volume.geometry);
  EXPECT_EQ(outcome.volume.type, SampleType::kUint8);
  EXPECT_EQ(outcome.volume.modality, "RTSTRUCT");
  EXPECT_EQ(outcome.volume.name, "plan");
  EXPECT_THAT(outcome.volume.labels,
              ElementsAre(LabelEntry{.label = 5, .name = "heart", .color = "#ff0000"},
                          LabelEntry{.label = 9, .name = "lung", .color = "#0080ff"}));
  EXPECT_EQ(sample(outcome, 2, 2, 2), 5);
  EXPECT_EQ(sample(outcome, 9, 2, 2), 9);
  EXPECT_EQ(outcome.volume.dicom->instances.front().sop_instance_uid, "1.2.77");
  EXPECT_EQ(outcome.volume.dicom->frame_of_reference_uid, "1.2.3.frame");
}

TEST(DicomStructures, HaveHolesByContoursWithinContoursAndByKeyholes) {
  const Points outer = box(1.3, 1.3, 15.7, 12.7, 2);
  const Points hole = box(4.4, 4.4, 9.6, 9.6, 2);
  // From the corner of the outer contour to the hole, around it, and back.
  Points keyhole = outer;
  keyhole.push_back(outer.front());
  keyhole.insert(keyhole.end(), hole.rbegin(), hole.rend());
  keyhole.push_back(hole.back());
  const Outcome two = draw({{.name = "ring", .contours = {{outer}, {hole, "CLOSEDPLANAR_XOR"}}}});
  expect_drawn(two, {outer, hole}, 1);
  EXPECT_EQ(sample(two, 6, 6, 1), 0);
  const Outcome one = draw({{.name = "ring", .contours = {{keyhole}}}});
  EXPECT_EQ(one.canonical, two.canonical);
  // A contour that is there twice is not its own hole.
  const Outcome doubled = draw({{.name = "ring", .contours = {{outer}, {hole}, {outer}, {hole}}}});
  EXPECT_EQ(doubled.canonical, two.canonical);
}

TEST(DicomStructures, AreInterpolatedBetweenTheirContours) {
  // In every other slice, and twice as wide at the end.
  const Outcome outcome = imported(draw({{.name = "cone",
                                          .contours = {{box(4.5, 4.5, 8.5, 10.5, 4)},
                                                       {box(4.5, 4.5, 8.5, 10.5, 8)},
                                                       {box(4.5, 4.5, 12.5, 10.5, 12)}}}}));
  for (std::uint32_t i = 0; i < 20; ++i) {
    EXPECT_EQ(sample(outcome, i, 7, 3), i >= 5 && i <= 8) << i;
    EXPECT_EQ(sample(outcome, i, 7, 5), i >= 5 && i <= 10) << i;
  }
  // Three planes 4 mm apart are six slices of 2 mm thick.
  EXPECT_EQ(sample(outcome, 6, 6, 0), 0);
  EXPECT_EQ(sample(outcome, 6, 6, 1), 1);
  EXPECT_EQ(sample(outcome, 6, 6, 7), 0);
  EXPECT_THAT(note_detail(outcome, NoteCode::kContoursInterpolated),
              AllOf(HasSubstr("2 times"), HasSubstr("The ends of 1 structure lie on slices")));
  // With contours 6 mm apart the ends lie between slices.
  const Outcome even = imported(
      draw({{.name = "box",
             .contours = {{box(4.5, 4.5, 8.5, 10.5, 4)}, {box(4.5, 4.5, 8.5, 10.5, 10)}}}}));
  EXPECT_EQ(note_detail(even, NoteCode::kContoursInterpolated).find("ends"), std::string::npos);
  EXPECT_NE(note_detail(even, NoteCode::kContoursInterpolated), "");
}

// 4 x 6 samples of a contour in each of four planes, between the slices at 4 mm and 12 mm.
TEST(DicomStructures, BetweenTheSlicesKeepTheirThickness) {
  std::vector<TestContour> contours;
  for (const double z : {5.0, 7.0, 9.0, 11.0}) contours.push_back({box(4.5, 4.5, 8.5, 10.5, z)});
  const Outcome between = imported(draw({{.name = "box", .contours = contours}}));
  EXPECT_EQ(between.volume.dims, (std::array<std::uint32_t, 3>{20, 16, 9}));
  EXPECT_EQ(between.volume.geometry.origin, (Vector3{0, 0, -1}));
  EXPECT_EQ(std::ranges::count(between.sample_bytes(), '\1'), 4 * 4 * 6);
  EXPECT_EQ(sample(between, 6, 6, 2), 0);
  EXPECT_EQ(sample(between, 6, 6, 3), 1);  // at 5 mm
  EXPECT_EQ(note_detail(between, NoteCode::kContoursInterpolated), "");
  // Beside contours in slices, they are drawn in slices, as many as they are.
  contours = {
      {box(4.5, 4.5, 8.5, 10.5, 5)}, {box(4.5, 4.5, 8.5, 10.5, 7)}, {box(4.5, 4.5, 8.5, 10.5, 9)}};
  const Outcome mixed =
      imported(draw({{.number = 1, .name = "between", .contours = contours},
                     {.number = 2, .name = "in", .contours = {{box(10.5, 4.5, 12.5, 6.5, 4)}}}}));
  EXPECT_EQ(mixed.volume.dims[2], 8U);
  EXPECT_EQ(std::ranges::count(mixed.sample_bytes(), '\1'), 3 * 4 * 6);
  EXPECT_EQ(std::ranges::count(mixed.sample_bytes(), '\2'), 2 * 2);
}

TEST(DicomStructures, OfSeparatePartsAreNotJoined) {
  const Outcome outcome = draw({{.name = "ends",
                                 .contours = {{box(4.5, 4.5, 8.5, 10.5, 0)},
                                              {box(4.5, 4.5, 8.5, 10.5, 2)},
                                              {box(4.5, 4.5, 8.5, 10.5, 12)},
                                              {box(4.5, 4.5, 8.5, 10.5, 14)}}}});
  for (std::uint32_t k = 0; k < 8; ++k) EXPECT_EQ(sample(outcome, 6, 6, k), k < 2 || k > 5) << k;
  EXPECT_EQ(note_detail(outcome, NoteCode::kContoursInterpolated), "");
}

// The numbers of combinations must not follow the order of planes and rows in the images.
TEST(DicomStructures, ThatOverlapAreOneVolumeInEachOrderOfTheirImages) {
  const DicomObject structures =
      structure_set({{.number = 1, .name = "a", .contours = {{box(1.5, 1.5, 8.5, 6.5, 4)}}},
                     {.number = 2, .name = "b", .contours = {{box(3.5, 2.5, 5.5, 4.5, 4)}}},
                     {.number = 3, .name = "c", .contours = {{box(1.5, 1.5, 8.5, 6.5, 10)}}},
                     {.number = 4, .name = "d", .contours = {{box(3.5, 2.5, 5.5, 4.5, 10)}}}});
  const Outcome first = imported(import_objects(with_images(structures), {.series = "1.2.9"}));
  DicomSeries mirrored = kImages;
  mirrored.origin[1] = 15;
  mirrored.along_column = {0, -1, 0};
  const Outcome other =
      imported(import_objects(with_images(structures, mirrored), {.series = "1.2.9"}));
  EXPECT_EQ(first.volume.stored_axes, "LPS");
  EXPECT_EQ(other.volume.stored_axes, "LAI");
  EXPECT_EQ(other.stored, first.stored);
  EXPECT_EQ(other.volume.labels, first.volume.labels);
  ASSERT_EQ(first.volume.labels.size(), 4);
  EXPECT_THAT(first.volume.labels[1].values, ElementsAre(5));
  EXPECT_THAT(first.volume.labels[3].values, ElementsAre(6));
}

TEST(DicomStructures, MayOverlap) {
  const Outcome outcome =
      imported(draw({{.number = 1, .name = "body", .contours = {{box(1.5, 1.5, 15.5, 12.5, 4)}}},
                     {.number = 2, .name = "heart", .contours = {{box(4.5, 4.5, 7.5, 8.5, 4)}}}}));
  EXPECT_EQ(sample(outcome, 2, 2, 2), 1);
  EXPECT_EQ(sample(outcome, 5, 5, 2), 3);
  ASSERT_EQ(outcome.volume.labels.size(), 2);
  EXPECT_THAT(outcome.volume.labels[0].values, ElementsAre(1, 3));
  EXPECT_THAT(outcome.volume.labels[1].values, ElementsAre(3));
  EXPECT_THAT(note_detail(outcome, NoteCode::kOverlappingSegments), HasSubstr("12 samples"));
  const Outcome second = import_objects(
      with_images(structure_set({{.number = 1, .contours = {{box(1.5, 1.5, 15.5, 12.5, 4)}}},
                                 {.number = 2, .contours = {{box(4.5, 4.5, 7.5, 8.5, 4)}}}})),
      {.series = "1.2.9", .volume = 1});
  EXPECT_EQ(sample(second, 5, 5, 2), 2);
  EXPECT_EQ(sample(second, 2, 2, 2), 0);
}

TEST(DicomStructures, AreOneOfTheSeriesOfTheirUpload) {
  const DicomObject object = structure_set({{.contours = {{box(1.5, 1.5, 5.5, 5.5, 4)}}}});
  const Outcome all = import_objects(with_images(object));
  EXPECT_THAT(all.remedy.choices,
              ElementsAre(IsChoice("series", "1.2.3.4", "CT, 8 slices"),
                          IsChoice("series", "1.2.9", "plan, RTSTRUCT, contours of structures")));
  EXPECT_EQ(import_objects(with_images(object), {.series = "1.2.3.4"}).volume.modality, "CT");
}

TEST(DicomStructures, AloneNeedASpacing) {
  const DicomObject object = structure_set(
      {{.contours = {
            {box(10, 20, 14, 26, 4)}, {box(10, 20, 14, 26, 7)}, {box(10, 20, 14, 26, 10)}}}});
  EXPECT_THAT(import_objects({{"RS", object.file()}}).error,
              AllOf(HasSubstr("spacing=X,Y,Z"), HasSubstr("3 mm apart")));
  const Outcome outcome = imported(draw_alone(object, {0.5, 1, 1}));
  EXPECT_THAT(outcome.volume.geometry.spacing, ElementsAre(0.5, 1, 1));
  EXPECT_THAT(outcome.volume.geometry.origin, ElementsAre(9.5, 19, 4 - 3));
  EXPECT_THAT(outcome.volume.dims, ElementsAre(4 * 2 + 3, 6 + 3, 6 + 7));
  // Nine slices: from half of 3 mm before the first plane to half of 3 mm behind the last.
  std::size_t inside = 0;
  for (const char each : outcome.sample_bytes()) inside += each != 0;
  EXPECT_EQ(inside, 8 * 6 * 9);
  // The grid of the request replaces that of the images.
  EXPECT_EQ(import_objects(with_images(object),
                           {.series = "1.2.9", .spacing = std::array<double, 3>{0.5, 1, 1}})
                .canonical,
            outcome.canonical);
}

TEST(DicomStructures, MayLieInAnyPlane) {
  Points coronal;
  for (const Vector3& point : box(1, 2, 5, 7, 30)) coronal.push_back({point[0], 30, point[1]});
  Points behind = coronal;
  for (Vector3& point : behind) point[1] = 32;
  const Outcome outcome =
      imported(draw_alone(structure_set({{.contours = {{coronal}, {behind}}}}), {1, 1, 2}));
  EXPECT_THAT(outcome.volume.geometry.direction, ElementsAre(1, 0, 0, 0, 0, 1, 0, -1, 0));
  std::size_t inside = 0;
  for (const char each : outcome.sample_bytes()) inside += each != 0;
  EXPECT_EQ(inside, 2 * 4 * 5);
}

TEST(DicomStructures, TellWhatIsNotDrawn) {
  Points tilted = box(1.5, 1.5, 9.5, 9.5, 4);
  tilted[2][2] = 8;
  const Outcome outcome =
      imported(draw({{.number = 1,
                      .name = "body",
                      .contours = {{box(1.5, 1.5, 9.5, 9.5, 2)},
                                   {tilted},
                                   {box(1.5, 1.5, 9.5, 9.5, 4), "OPEN_PLANAR"},
                                   {{{1, 1, 1}}, "POINT"},
                                   {{{1, 1, 1}, {2, 2, 1}}}}},
                     {.number = 2, .name = "marker", .contours = {}},
                     {.number = 3, .name = "far", .contours = {{box(100, 100, 110, 110, 2)}}}}));
  EXPECT_THAT(note_detail(outcome, NoteCode::kContoursSkipped),
              AllOf(HasSubstr("3 contours not closed"), HasSubstr("1 contour not parallel"),
                    HasSubstr("1 structure without closed"), HasSubstr("1 structure with no")));
  EXPECT_EQ(outcome.volume.labels.size(), 1);
}

// A box in the slices of kImages, or beyond them.
std::vector<TestContour> boxes(double left, double top, double right, double bottom,
                               const std::vector<double>& heights) {
  std::vector<TestContour> contours;
  for (const double z : heights) contours.push_back({box(left, top, right, bottom, z)});
  return contours;
}

std::uint64_t voxels_of(const Outcome& outcome, char label) {
  return static_cast<std::uint64_t>(std::ranges::count(outcome.sample_bytes(), label));
}

const std::vector<double> kHeights = {4, 6, 8};

TEST(DicomStructures, TellThatTheGridCutsThem) {
  struct Case {
    std::vector<TestContour> contours;
    std::uint64_t there;  // samples on the grid
    std::uint64_t whole;  // all samples of 1 x 1 x 2 mm
  };
  const std::vector<Case> cut = {
      {boxes(15.5, 4.5, 24.5, 8.5, kHeights), 4 * 4 * 3, 9 * 4 * 3},
      {boxes(-3.5, 4.5, 2.5, 8.5, kHeights), 3 * 4 * 3, 6 * 4 * 3},
      {boxes(4.5, 12.5, 8.5, 19.5, kHeights), 4 * 3 * 3, 4 * 7 * 3},
      {boxes(4.5, -1.5, 8.5, 2.5, kHeights), 4 * 3 * 3, 4 * 4 * 3},
      {boxes(4.5, 4.5, 8.5, 8.5, {-4, -2, 0, 2}), 4 * 4 * 2, 4 * 4 * 4},
      {boxes(4.5, 4.5, 8.5, 8.5, {12, 14, 16}), 4 * 4 * 2, 4 * 4 * 3},
  };
  for (const auto& [contours, there, whole] : cut) {
    SCOPED_TRACE(testing::PrintToString(contours.front().points));
    const std::vector<TestStructure> set = {
        {.number = 3, .name = "inside", .contours = boxes(4.5, 9.5, 8.5, 11.5, kHeights)},
        {.number = 7, .name = "cut", .contours = contours}};
    const Outcome outcome = imported(draw(set));
    EXPECT_EQ(voxels_of(outcome, 7), there);
    EXPECT_THAT(
        note_detail(outcome, NoteCode::kContoursSkipped),
        AllOf(HasSubstr("1 structure where the grid ends before the contours do (label 7)"),
              HasSubstr("Add spacing=X,Y,Z (mm), such as 1,1,2, to draw"), Not(HasSubstr("cut"))));
    // The remedy has all of it.
    const Outcome all = imported(draw_alone(structure_set(set), {1, 1, 2}));
    EXPECT_EQ(voxels_of(all, 7), whole);
    EXPECT_EQ(note_detail(all, NoteCode::kContoursSkipped), "");
  }
}

TEST(DicomStructures, TellNothingOfACutThatLeavesNoSampleOut) {
  // The contours end less than a sample beyond the outermost ones, in all slices.
  const Outcome outcome = imported(draw(
      {{.number = 1, .contours = boxes(-0.9, -0.5, 19.5, 15.9, {0, 2, 4, 6, 8, 10, 12, 14})}}));
  EXPECT_EQ(note_detail(outcome, NoteCode::kContoursSkipped), "");
  EXPECT_EQ(voxels_of(outcome, 1), 20U * 16 * 8);
}

TEST(DicomStructures, BeyondTheGridOrOnOtherPlanesAreOfferedAGridOfTheirOwn) {
  const std::vector<TestStructure> beyond = {{.contours = boxes(195.5, 4.5, 199.5, 8.5, kHeights)}};
  EXPECT_THAT(draw(beyond).error,
              AllOf(HasSubstr("No contour"), HasSubstr("of its images"),
                    HasSubstr("Add spacing=X,Y,Z (mm), such as 1,1,2, to draw")));
  EXPECT_EQ(voxels_of(imported(draw_alone(structure_set(beyond), {1, 1, 2})), 1), 4U * 4 * 3);
  // Sagittal planes, 1.5 mm apart.
  std::vector<TestContour> sagittal;
  for (const double x : {4.0, 5.5, 7.0}) {
    sagittal.push_back({{{x, 2.5, 2}, {x, 8.5, 2}, {x, 8.5, 10}, {x, 2.5, 10}}});
  }
  const std::vector<TestStructure> tilted = {{.contours = sagittal}};
  EXPECT_THAT(draw(tilted).error, HasSubstr("Add spacing=X,Y,Z (mm), such as 1,1,1.5, to draw"));
  EXPECT_EQ(voxels_of(imported(draw_alone(structure_set(tilted), {1, 1, 1.5})), 1), 6U * 8 * 3);
  // The triangle lies between all samples of the grid that was asked for.
  const Points triangle = {{4.2, 4.4, 2}, {4.3, 4.2, 2}, {4.4, 4.4, 2}};
  const std::vector<TestStructure> small = {{.contours = {{triangle}}}};
  EXPECT_THAT(draw_alone(structure_set(small), {1, 1, 2}).error,
              AllOf(HasSubstr("No contour"), HasSubstr("A smaller spacing=X,Y,Z"),
                    Not(HasSubstr("images"))));
}

DicomObject with_data(const std::string& data) {
  return structure_set({}).items(
      kRoiContourSequence,
      {DicomObject()
           .items(kContourSequence, {DicomObject()
                                         .text(kContourGeometricType, "CS", "CLOSED_PLANAR")
                                         .text(kContourData, "DS", data)})
           .text(kReferencedRoiNumber, "IS", "1")});
}

TEST(DicomStructures, AreRefusedWithTheReason) {
  const std::array<double, 3> fine = {1, 1, 1};
  for (const std::string_view data :
       {"1\\2\\3\\4", "1\\2\\nan\\4\\5\\6\\7\\8\\9", "1\\2\\x", "1\\2\\1e999\\4\\5\\6\\7\\8\\9"}) {
    EXPECT_THAT(draw_alone(with_data(std::string(data)), fine).error,
                AllOf(HasSubstr("Contour 1"), HasSubstr("triples of finite numbers")))
        << data;
  }
  EXPECT_THAT(draw_alone(structure_set({}), fine).error, HasSubstr("no closed contours"));
  EXPECT_THAT(draw_alone(with_data("0\\0\\0\\1e9\\0\\0\\0\\1e9\\0"), fine).error,
              HasSubstr("more than 65535 samples"));
  EXPECT_NE(draw_alone(with_data("0\\0\\0\\1e300\\0\\0\\0\\1e300\\0"), fine).error, "");
  EXPECT_NE(draw_alone(with_data("0\\0\\0\\60000\\0\\0\\0\\60000\\60000"), fine).error, "");
  EXPECT_THAT(draw({{.contours = {{box(100, 100, 110, 110, 2)}}}}).error, HasSubstr("No contour"));
}

// A hundred thousand points of a spiral that crosses itself.
TEST(DicomStructures, MayHaveManyPoints) {
  Points spiral;
  for (int at = 0; at < 100000; ++at) {
    spiral.push_back(
        {10 + 0.00009 * at * std::cos(at * 0.01), 8 + 0.00007 * at * std::sin(at * 0.01), 6});
  }
  // As the file has them: with six decimals.
  for (Vector3& point : spiral) {
    for (double& part : point) part = std::stod(std::to_string(part));
  }
  expect_drawn(draw({{.name = "spiral", .contours = {{spiral}}}}), {spiral}, 3);
}

TEST(SignedDistances, AreThoseOfAllPairs) {
  std::mt19937 random(11);
  const std::array<double, 2> spacing = {0.7, 1.9};
  for (int round = 0; round < 20; ++round) {
    Mask mask(13, 9);
    for (auto& each : mask.samples) each = random() % 4 == 0;
    const std::vector<float> distances = signed_distances(mask, spacing);
    for (int j = 0; j < 9; ++j) {
      for (int i = 0; i < 13; ++i) {
        const bool inside = mask.samples[j * 13 + i] != 0;
        double least = 1e9;
        for (int v = -1; v <= 9; ++v) {
          for (int u = -1; u <= 13; ++u) {
            const bool is_beyond = u < 0 || v < 0 || u == 13 || v == 9;
            const bool other = !is_beyond && mask.samples[v * 13 + u] != 0;
            if (other == inside) continue;
            least = std::min(least, std::hypot((u - i) * spacing[0], (v - j) * spacing[1]));
          }
        }
        ASSERT_NEAR(distances[j * 13 + i], inside ? least : -least, 1e-5) << i << ' ' << j;
      }
    }
  }
}

// The structures lie where the images do, so what is said of these holds for them.
TEST(DicomStructures, HaveTheNotesOnTheGeometryOfTheirImages) {
  DicomSeries images = kImages;
  images.step = {0, 0, 2.5};
  NamedFiles files = changed(images, [](DicomObject& object, std::uint32_t k) {
    object.text(kFrameOfReferenceUid, "UI", "1.2.3.frame")
        .text(kImagePosition, "DS", "0\\0\\" + std::to_string((k * 5 + 1) / 2));
  });
  const DicomObject structures = structure_set({{.contours = {{box(1.5, 1.5, 6.5, 6.5, 5)}}}});
  files.emplace_back("RS", structures.file(kImplicit));
  const ImportOptions options = {.series = "1.2.9"};
  const Outcome outcome = imported(import_objects(files, options));
  EXPECT_THAT(note_detail(outcome, NoteCode::kPositionsRounded), HasSubstr("rounded to 1 mm"));
}

}  // namespace
}  // namespace isomesh::import::test
