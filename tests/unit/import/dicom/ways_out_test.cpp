// Series that are read with a note, or that a person can accept, because others read them.
#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// The positions along z that a scanner wrote.
NamedFiles at_heights(const std::vector<double>& heights,
                      const std::function<void(DicomObject&, std::uint32_t)>& change = {}) {
  const DicomSeries series = {.slices = static_cast<std::uint32_t>(heights.size())};
  return changed(series, [&](DicomObject& object, std::uint32_t k) {
    object.text(kImagePosition, "DS", "-10\\20\\" + to_text(heights[k]));
    if (change) change(object, k);
  });
}

std::vector<double> rounded_heights(std::size_t count, double step, double unit) {
  std::vector<double> heights;
  for (std::size_t k = 0; k < count; ++k) {
    heights.push_back(std::round((30 + step * static_cast<double>(k)) / unit) * unit);
  }
  return heights;
}

// --- Positions -----------------------------------------------------------------------------------

TEST(DicomPositions, ThatAreRoundedAreReadAsEvenOnes) {
  struct Case {
    double step;
    double unit;
  };
  for (const auto& [step, unit] :
       {Case{1.25, 0.1}, Case{0.625, 0.1}, Case{0.33, 0.1}, Case{0.0625, 0.01}, Case{2.5, 1},
        Case{3.75, 1}, Case{-1.25, 0.1}}) {
    const Outcome outcome = imported(import_objects(at_heights(rounded_heights(24, step, unit))));
    // The first and the last slice are off by half of the unit at most.
    EXPECT_NEAR(outcome.volume.geometry.spacing[2], std::abs(step), unit / 23) << step;
    const double first = step > 0 ? 30 : 30 + 23 * step;
    EXPECT_NEAR(outcome.volume.geometry.origin[2], first, unit * 1.01) << step;
    EXPECT_THAT(note_detail(outcome, NoteCode::kPositionsRounded),
                HasSubstr("rounded to " + to_text(unit) + " mm"))
        << step;
  }
}

TEST(DicomPositions, ThatAreRoundedObliquelyAreReadAsEvenOnes) {
  const double half = std::numbers::sqrt2 / 2;
  DicomSeries series = {.slices = 20, .along_row = {half, half, 0}, .along_column = {0, 0, 1}};
  series.step = {1.25 * half, -1.25 * half, 0};
  const Outcome outcome =
      imported(import_objects(changed(series, [&](DicomObject& object, std::uint32_t k) {
        const Vector3 place = series.position(k);
        std::string text;
        for (const double part : place) {
          text += (text.empty() ? "" : "\\") + to_text(std::round(part * 10) / 10);
        }
        object.text(kImagePosition, "DS", text);
      })));
  EXPECT_NEAR(outcome.volume.geometry.spacing[2], 1.25, 0.01);
  EXPECT_NE(note_detail(outcome, NoteCode::kPositionsRounded), "");
}

TEST(DicomPositions, ThatAreEvenNeedNoNote) {
  const Outcome outcome = imported(import_objects(at_heights(rounded_heights(12, 2.5, 0.1))));
  EXPECT_EQ(outcome.volume.geometry.spacing[2], 2.5);
  EXPECT_EQ(outcome.volume.notes.size(), 0);
}

// A slice that is missing is never hidden by rounding.
TEST(DicomPositions, StillShowThatASliceIsMissing) {
  for (const double unit : {0.1, 0.01}) {
    for (const std::size_t missing : {1U, 7U, 22U}) {
      std::vector<double> heights = rounded_heights(24, 1.25, unit);
      heights.erase(heights.begin() + static_cast<std::ptrdiff_t>(missing));
      const Outcome outcome =
          import_objects(at_heights(heights), {.accept = {"positions-rounded"}});
      EXPECT_THAT(outcome.error,
                  HasSubstr("slice " + std::to_string(missing + 1) + " of 24 is missing"));
      EXPECT_EQ(outcome.remedy.overridable, "");
    }
  }
  // Even if most gaps are wide.
  EXPECT_THAT(import_objects(at_heights({0, 2, 3})).error, HasSubstr("slice 2 of 4 is missing"));
  EXPECT_THAT(import_objects(at_heights({0, 5, 7.5, 12.5, 20})).error,
              HasSubstr("slices 2, 5, 7 and 8 of 9 are missing"));
  // Whole millimetres may stand for steps of 2.5 mm with all slices, or of 2 mm without one.
  const Outcome doubtful = import_objects(at_heights({0, 2, 5}));
  EXPECT_EQ(doubtful.remedy.overridable, "positions-rounded");
}

// Gaps of one and two units look as if slices were missing.
TEST(DicomPositions, RoundedToWholeStepsCanBeAccepted) {
  for (const double step : {1.25, 1.5}) {
    const std::vector<double> heights = rounded_heights(24, step, 1);
    const Outcome refused = import_objects(at_heights(heights));
    EXPECT_EQ(refused.remedy.overridable, "positions-rounded");
    EXPECT_THAT(refused.error, AllOf(HasSubstr("The series is incomplete"),
                                     HasSubstr("Or its positions are rounded")));
    const Outcome outcome =
        imported(import_objects(at_heights(heights), {.accept = {"positions-rounded"}}));
    EXPECT_EQ(outcome.volume.dims[2], 24);
    EXPECT_NEAR(outcome.volume.geometry.spacing[2], step, 1.0 / 23);
    EXPECT_THAT(note_detail(outcome, NoteCode::kPositionsRounded),
                HasSubstr("The request accepts"));
  }
}

TEST(DicomPositions, ThatAreUnevenCanBeAccepted) {
  const std::vector<double> heights = {0, 2.5, 5, 7.9, 10, 12.5};
  const Outcome outcome = import_objects(at_heights(heights));
  EXPECT_EQ(outcome.remedy.overridable, "positions-rounded");
  EXPECT_THAT(outcome.error,
              AllOf(HasSubstr("slices 3 and 4 of 6 (\"IM3\", \"IM4\") are 2.9 mm apart"),
                    HasSubstr("accept=positions-rounded"), HasSubstr("up to 0.2")));
  const Outcome accepted =
      imported(import_objects(at_heights(heights), {.accept = {"positions-rounded"}}));
  EXPECT_NEAR(accepted.volume.geometry.spacing[2], 2.5, 0.1);
  EXPECT_THAT(note_detail(accepted, NoteCode::kPositionsRounded), HasSubstr("The request accepts"));
}

TEST(DicomPositions, ThatGrowCannotBeAccepted) {
  const std::vector<double> heights = {0, 1, 2.2, 3.6, 5.3, 7.4, 10, 13.2, 17, 21.5};
  const Outcome outcome = import_objects(at_heights(heights), {.accept = {"positions-rounded"}});
  EXPECT_THAT(outcome.error, HasSubstr("unevenly spaced"));
  EXPECT_EQ(outcome.remedy.overridable, "");
}

// --- Slices at one place -------------------------------------------------------------------------

DicomObject copy_of(std::uint32_t slice) {
  DicomObject object = DicomSeries{}.slice(slice);
  return object.text(kSopInstanceUid, "UI", "1.2.3.99").text(kContentTime, "TM", "1200");
}

TEST(DicomDuplicates, WithTheSameSamplesAreLeftOut) {
  const std::string expected = imported(import_objects(DicomSeries{}.files())).canonical;
  NamedFiles files = at_heights({30, 32.5, 35, 37.5, 40, 42.5});
  files.emplace_back("again", copy_of(2).file());
  for (const bool is_first : {false, true}) {
    if (is_first) std::rotate(files.begin(), files.end() - 1, files.end());
    const Outcome outcome = imported(import_objects(files));
    EXPECT_EQ(outcome.canonical, expected);
    EXPECT_THAT(note_detail(outcome, NoteCode::kDuplicateSlice),
                AllOf(HasSubstr("1 slice was left out"), Not(HasSubstr("again"))));
    ASSERT_EQ(outcome.volume.ignored.size(), 1);
    EXPECT_EQ(outcome.volume.ignored[0].name, "again");
    EXPECT_EQ(outcome.volume.dicom->instances.size(), 6);
  }
}

TEST(DicomDuplicates, ThatDifferCanBeAccepted) {
  const std::string expected = imported(import_objects(DicomSeries{}.files())).canonical;
  const std::pair<const char*, std::function<void(DicomObject&)>> changes[] = {
      {"samples", [](DicomObject& object) { object.pixels(std::string(40, '\1'), 2); }},
      {"rescale", [](DicomObject& object) { object.text(kRescaleIntercept, "DS", "5"); }}};
  for (const auto& [what, change] : changes) {
    NamedFiles files = at_heights({30, 32.5, 35, 37.5, 40, 42.5}, [](DicomObject& object, auto) {
      object.text(kRescaleIntercept, "DS", "0");
    });
    DicomObject other = copy_of(2).text(kRescaleIntercept, "DS", "0");
    change(other.text(kInstanceNumber, "IS", "9"));
    files.insert(files.begin(), {"again", other.file()});
    const Outcome outcome = import_objects(files);
    EXPECT_EQ(outcome.remedy.overridable, "duplicate-slice") << what;
    EXPECT_THAT(outcome.error, HasSubstr("\"IM3\" and \"again\" lie at one position")) << what;
    EXPECT_THAT(outcome.error, HasSubstr("at 1 of 6 positions")) << what;
    const Outcome accepted = imported(import_objects(files, {.accept = {"duplicate-slice"}}));
    EXPECT_EQ(accepted.canonical, expected) << what;
    EXPECT_THAT(note_detail(accepted, NoteCode::kDuplicateSlice), HasSubstr("other samples"));
    EXPECT_EQ(accepted.volume.ignored.at(0).name, "again");
  }
}

// Two echoes, of which slices are missing, are no volume with duplicates.
TEST(DicomDuplicates, AtHalfOfThePositionsCannotBeAccepted) {
  struct Case {
    std::uint32_t doubled;
    std::uint32_t different;
    bool is_accepted;
  };
  for (const auto& [doubled, different, is_accepted] :
       {Case{2, 2, true}, Case{3, 3, false}, Case{5, 5, false}, Case{4, 2, false},
        Case{5, 1, true}}) {
    NamedFiles files = DicomSeries{}.files();
    for (std::uint32_t k = 0; k < doubled; ++k) {
      DicomObject other = DicomSeries{}.slice(k).text(kSopInstanceUid, "UI", "1.2.9." + to_text(k));
      if (k < different) other.pixels(std::string(40, '\1'), 2);
      files.emplace_back("B" + to_text(k), other.file());
    }
    const Outcome outcome = import_objects(files, {.accept = {"duplicate-slice"}});
    const std::string share = to_text(different) + " of 6 positions";
    if (is_accepted) {
      EXPECT_THAT(note_detail(outcome, NoteCode::kDuplicateSlice), HasSubstr(share));
      continue;
    }
    EXPECT_THAT(outcome.error, AllOf(HasSubstr(share), HasSubstr("several volumes"))) << doubled;
    EXPECT_EQ(outcome.remedy.overridable, "");
  }
}

TEST(DicomDuplicates, AtEachPositionAreSeveralVolumes) {
  NamedFiles files = DicomSeries{}.files();
  for (std::uint32_t k = 0; k < 6; ++k) {
    files.emplace_back("again" + std::to_string(k), DicomSeries{.uid = "1.2.3.4"}
                                                        .slice(k)
                                                        .text(kEchoTime, "DS", "5")
                                                        .text(kSopInstanceUid, "UI", "1.2.9")
                                                        .file());
  }
  const Outcome outcome = import_objects(files);
  EXPECT_EQ(outcome.remedy.overridable, "");
  EXPECT_EQ(outcome.remedy.choices.size(), 2);
}

// A series that was stored twice, with new UIDs.
TEST(DicomDuplicates, OfAWholeSeriesAreLeftOut) {
  NamedFiles files = DicomSeries{}.files();
  const auto again = [](std::uint32_t k) {
    return DicomSeries{}.slice(k).text(kSopInstanceUid, "UI", "1.2.3.99." + std::to_string(k));
  };
  for (std::uint32_t k = 0; k < 6; ++k) files.emplace_back("B" + to_text(k), again(k).file());
  const Outcome outcome = imported(import_objects(files));
  EXPECT_EQ(outcome.canonical, import_objects(DicomSeries{}.files()).canonical);
  EXPECT_THAT(note_detail(outcome, NoteCode::kDuplicateSlice), HasSubstr("6 slices were left out"));
  files.back().second = again(5).pixels(std::string(40, '\1'), 2).file();
  EXPECT_THAT(import_objects(files).error,
              AllOf(HasSubstr("2 slices at each of its 6 positions"), HasSubstr("\"B0\"")));
}

TEST(DicomDuplicates, AmongFramesAreLeftOut) {
  const DicomSeries series;
  const Outcome outcome =
      imported(import_objects({{"one", series.enhanced({0, 1, 2, 3, 3, 4, 5}).file()}}));
  EXPECT_EQ(outcome.canonical, import_objects(series.files()).canonical);
  EXPECT_NE(note_detail(outcome, NoteCode::kDuplicateSlice), "");
  EXPECT_EQ(outcome.volume.ignored.size(), 0);
}

// --- Frames without positions --------------------------------------------------------------------

DicomObject one_position(const char* spacing, const char* thickness) {
  const DicomSeries series = {.step = {0, 0, 2}};
  std::string pixels;
  for (std::uint32_t k = 0; k < series.slices; ++k) pixels += series.native_bytes(k);
  DicomObject object = series.slice(0).text(kNumberOfFrames, "IS", "6").pixels(pixels, 2);
  if (*spacing != '\0') object.text(kSpacingBetweenSlices, "DS", spacing);
  if (*thickness != '\0') object.text(kSliceThickness, "DS", thickness);
  return object;
}

TEST(DicomFrames, WithOnePositionCanBeAccepted) {
  struct Case {
    const char* spacing;
    const char* thickness;
    const char* told;
    double step;
  };
  const ImportOptions accepting = {.accept = {"distance-assumed"}};
  for (const auto& [spacing, thickness, told, step] :
       {Case{"2", "9", "spacing between slices", 2}, Case{"", "2", "slice thickness", 2},
        Case{"-2", "", "spacing between slices", -2}}) {
    const std::string file = one_position(spacing, thickness).file();
    const Outcome outcome = import_objects({{"one", file}});
    EXPECT_EQ(outcome.remedy.overridable, "distance-assumed");
    EXPECT_THAT(outcome.error, AllOf(HasSubstr("6 frames, but no position for each"),
                                     HasSubstr("2 mm apart"), HasSubstr(told)));
    const Outcome accepted = imported(import_objects({{"one", file}}, accepting));
    const DicomSeries expected = {.step = {0, 0, step}};
    EXPECT_EQ(accepted.canonical, import_objects(expected.files()).canonical);
    EXPECT_THAT(note_detail(accepted, NoteCode::kDistanceAssumed),
                AllOf(HasSubstr("ascending frame number"),
                      HasSubstr(step > 0 ? "(0, 0, 1)" : "(0, 0, -1)")));
  }
  const Outcome unknown = import_objects({{"one", one_position("", "").file()}}, accepting);
  EXPECT_THAT(unknown.error, HasSubstr("no distance between them (0018,0088)"));
  DicomObject placeless = one_position("2", "");
  placeless.erase(kImagePosition);
  EXPECT_THAT(import_objects({{"one", placeless.file()}}, accepting).error,
              HasSubstr("no position for each of them"));
}

TEST(DicomFrames, WithOnePositionMayBeTimes) {
  const auto error_of = [](const char* pointer) {
    DicomObject object = one_position("2", "");
    return import_objects(
               {{"one",
                 object.bytes(kFrameIncrementPointer, "AT", std::string(pointer, 4)).file()}})
        .error;
  };
  EXPECT_THAT(error_of("\x18\0\x63\x10"), HasSubstr("one slice at several times"));
  EXPECT_THAT(error_of("\x18\0\x65\x10"), HasSubstr("one slice at several times"));
  EXPECT_THAT(error_of("\x18\0\x88\0"), Not(HasSubstr("times")));
}

// Each frame tells the same place.
TEST(DicomFrames, ThatRepeatAPositionCanBeAccepted) {
  const DicomSeries series = {.step = {0, 0, 2}};
  DicomObject object = series.enhanced({0, 1, 2, 3, 4, 5});
  object.items(kPerFrameFunctionalGroups, std::vector<DicomObject>(6, frame_at(series.position(0))))
      .text(kSpacingBetweenSlices, "DS", "2");
  const std::string file = object.file();
  EXPECT_EQ(import_objects({{"one", file}}).remedy.overridable, "distance-assumed");
  EXPECT_EQ(import_objects({{"one", file}}, {.accept = {"distance-assumed"}}).canonical,
            import_objects(series.files()).canonical);
}

// Enhanced objects may share a position, too.
TEST(DicomFrames, ThatShareAPositionCanBeAccepted) {
  const DicomSeries series = {.step = {0, 0, 2}};
  DicomObject shared = shared_groups().items(
      kPlanePositionSequence, {DicomObject().text(kImagePosition, "DS", "-10\\20\\30")});
  shared.items(kPixelMeasuresSequence, {DicomObject()
                                            .text(kPixelSpacing, "DS", "0.5\\0.75")
                                            .text(kSpacingBetweenSlices, "DS", "2")});
  for (const std::size_t described : {0U, 6U}) {
    const std::string file =
        series.enhanced({0, 1, 2, 3, 4, 5})
            .items(kSharedFunctionalGroups, {shared})
            .items(kPerFrameFunctionalGroups, std::vector<DicomObject>(described))
            .file();
    EXPECT_EQ(import_objects({{"one", file}}).remedy.overridable, "distance-assumed");
    EXPECT_EQ(import_objects({{"one", file}}, {.accept = {"distance-assumed"}}).canonical,
              import_objects(series.files()).canonical);
  }
}

// --- Directions ----------------------------------------------------------------------------------

NamedFiles directed(const std::string& cosines) {
  return changed(DicomSeries{},
                 [&](DicomObject& object) { object.text(kImageOrientation, "DS", cosines); });
}

// The column's direction turns by the angle, in the plane.
NamedFiles skewed(double degrees) {
  const double angle = degrees * std::numbers::pi / 180;
  return directed("1\\0\\0\\" + to_text(std::sin(angle)) + '\\' + to_text(std::cos(angle)) + "\\0");
}

TEST(DicomDirections, ThatAreNearlyPerpendicularAreCorrected) {
  for (const double degrees : {0.29, -0.29, 0.99}) {
    const Outcome outcome = imported(import_objects(skewed(degrees)));
    const auto& direction = outcome.volume.geometry.direction;
    const double half = degrees / 2 * std::numbers::pi / 180;
    EXPECT_NEAR(direction[0], std::cos(half), 1e-7);
    EXPECT_NEAR(direction[3], -std::sin(half), 1e-7);
    EXPECT_NEAR(direction[1], std::sin(half), 1e-7);
    EXPECT_NEAR(direction[4], std::cos(half), 1e-7);
    EXPECT_THAT(note_detail(outcome, NoteCode::kDirectionsCorrected),
                HasSubstr(to_text(std::abs(degrees)) + " degrees"));
  }
  EXPECT_EQ(imported(import_objects(skewed(0.05))).volume.notes.size(), 0);
}

TEST(DicomDirections, ThatAreFartherOffCanBeAccepted) {
  const Outcome refused = import_objects(skewed(2));
  EXPECT_EQ(refused.remedy.overridable, "directions-corrected");
  EXPECT_THAT(refused.error, HasSubstr("\"IM1\""));
  const ImportOptions accepting = {.accept = {"directions-corrected"}};
  EXPECT_NE(
      note_detail(imported(import_objects(skewed(2), accepting)), NoteCode::kDirectionsCorrected),
      "");
  EXPECT_THAT(import_objects(skewed(6), accepting).error,
              HasSubstr("(0020,0037) are 6 degrees away"));
}

TEST(DicomDirections, WithTwoDecimalsAreUnitVectorsAgain) {
  const Outcome outcome = imported(import_objects(directed("0.71\\0.71\\0\\-0.71\\0.71\\0")));
  EXPECT_NEAR(outcome.volume.geometry.direction[0], std::numbers::sqrt2 / 2, 1e-7);
  EXPECT_THAT(note_detail(outcome, NoteCode::kDirectionsCorrected), HasSubstr("0.004"));
  EXPECT_EQ(import_objects(directed("1.03\\0\\0\\0\\1\\0")).remedy.overridable,
            "directions-corrected");
}

// --- Headers -------------------------------------------------------------------------------------

// No value depends on it.
TEST(DicomHeader, MayLackThePhotometricInterpretationOfGreySamples) {
  const NamedFiles files =
      changed(DicomSeries{}, [](DicomObject& object) { object.erase(kPhotometricInterpretation); });
  EXPECT_EQ(imported(import_objects(files)).canonical,
            import_objects(DicomSeries{}.files()).canonical);
  EXPECT_THAT(
      import_objects(changed(DicomSeries{},
                             [](DicomObject& object) {
                               object.erase(kPhotometricInterpretation).number(kSamplesPerPixel, 3);
                             }))
          .error,
      HasSubstr("in colour"));
}

}  // namespace
}  // namespace isomesh::import::test
