// Series of several volumes, and what may be overlooked in a series.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

constexpr std::uint32_t kVolumes = 3;

using Change = std::function<void(DicomObject&, std::uint32_t volume, std::uint32_t slice)>;

// Every slice in `kVolumes` versions, whose first sample is the volume's number.
NamedFiles several(const Change& change) {
  const DicomSeries series;
  NamedFiles files;
  for (std::uint32_t slice = 0; slice < series.slices; ++slice) {
    for (std::uint32_t volume = 0; volume < kVolumes; ++volume) {
      std::string pixels = series.native_bytes(slice);
      pixels[0] = static_cast<char>(volume);
      pixels[1] = 0;
      DicomObject object = series.slice(slice);
      object.pixels(pixels, 2)
          .text(kSopInstanceUid, "UI", "1.2." + std::to_string(slice * kVolumes + volume))
          .erase(kInstanceNumber);
      change(object, volume, slice);
      files.emplace_back("F" + std::to_string(files.size()), object.file());
    }
  }
  return files;
}

NamedFiles with_echoes() {
  return several([](DicomObject& object, std::uint32_t volume, std::uint32_t slice) {
    // Numbers are compared as such: 10.5 comes after 5.25.
    object.text(kEchoTime, "DS", volume == 0 ? "5.25" : volume == 1 ? "10.50" : "100");
    // Values that change from slice to slice do not distinguish volumes.
    object.text(kAcquisitionTime, "TM", std::to_string(100000 + slice * 7 + volume));
  });
}

void expect_all_volumes(const NamedFiles& files) {
  for (std::uint32_t volume = 0; volume < kVolumes; ++volume) {
    const Outcome outcome = imported(import_objects(files, {.volume = volume}));
    EXPECT_EQ(outcome.volume.dims[2], 6);
    for (std::size_t slice = 0; slice < 6; ++slice) {
      ASSERT_EQ(samples_of<std::int16_t>(outcome)[slice * 20], volume);
    }
    EXPECT_NE(note_detail(outcome, NoteCode::kVolumeChosen), "");
    EXPECT_EQ(outcome.volume.dicom->instances.size(), 6);
  }
}

TEST(DicomVolumes, AreOfferedWithWhatTheyDifferIn) {
  const Outcome outcome = import_objects(with_echoes());
  EXPECT_EQ(outcome.code, ErrorCode::kUnusableVolume);
  EXPECT_THAT(outcome.error, HasSubstr("3 volumes that differ in EchoTime"));
  EXPECT_THAT(outcome.remedy.choices, ElementsAre(Choice{"volume", "0", "EchoTime 5.25, 6 slices"},
                                                  Choice{"volume", "1", "EchoTime 10.50, 6 slices"},
                                                  Choice{"volume", "2", "EchoTime 100, 6 slices"}));
  expect_all_volumes(with_echoes());
  EXPECT_THAT(import_objects(with_echoes(), {.volume = 3}).error, HasSubstr("It has no volume 3"));
}

TEST(DicomVolumes, AreToldApartByTheAttributeThatDoes) {
  const std::pair<const char*, Change> changes[] = {
      {"TemporalPositionIdentifier",
       [](DicomObject& object, std::uint32_t volume, std::uint32_t) {
         object.text(kTemporalPositionIdentifier, "IS", std::to_string(volume + 9));
       }},
      {"DiffusionBValue",
       [](DicomObject& object, std::uint32_t volume, std::uint32_t) {
         object.bytes(kDiffusionBValue, "FD", bytes_of(std::vector{volume * 1000.0}));
       }},
      {"ImageType",
       [](DicomObject& object, std::uint32_t volume, std::uint32_t) {
         object.text(kImageType, "CS", std::string("ORIGINAL\\PRIMARY\\") + "MPR"[volume]);
         if (volume == 2) object.text(kImageType, "CS", "ORIGINAL\\PRIMARY\\R");
       }},
  };
  for (const auto& [name, change] : changes) {
    EXPECT_THAT(import_objects(several(change)).error,
                HasSubstr("3 volumes that differ in " + std::string(name)));
  }
}

// Between each other, their slices are evenly spaced as well.
TEST(DicomVolumes, AreToldApartWhereTheyAlternate) {
  DicomSeries series;
  const auto files_of = [&](Tag tag, const std::vector<std::string>& values) {
    return changed(
        series, [&](DicomObject& object, std::uint32_t k) { object.text(tag, "DS", values[k]); });
  };
  const NamedFiles echoes = files_of(kEchoTime, {"5", "80", "5", "80", "5", "80"});
  EXPECT_THAT(import_objects(echoes).error, HasSubstr("2 volumes that differ in EchoTime"));
  const Outcome second = imported(import_objects(echoes, {.volume = 1}));
  EXPECT_EQ(second.volume.dims[2], 3);
  EXPECT_EQ(second.volume.geometry.spacing[2], 5);
  EXPECT_EQ(samples_of<std::int16_t>(second)[0], series.stored(0, 0, 1));
  series.slices = 7;
  EXPECT_EQ(
      import_objects(files_of(kEchoTime, {"5", "80", "5", "80", "5", "80", "5"}), {.volume = 1})
          .volume.dims[2],
      3);

  for (const NamedFiles& whole : {
           files_of(kEchoTime, {"5", "5", "5", "80", "80", "80", "80"}),  // behind each other
           files_of(kEchoTime, {"5", "5", "80", "5", "80", "80", "5"}),  // neither is evenly spaced
           files_of(kEchoTime, {"1", "2", "3", "4", "5", "6", "7"}),
           files_of(kEchoTime, {"4.6", "4.60", "4.6", "4.60", "4.6", "4.61", "4.6"}),
           files_of(kTemporalPositionIdentifier, {"1", "2", "3", "1", "2", "3", "1"}),
           files_of(kEchoTime, {"5", "", "5", "", "5", "", "5"}),
           files_of(kTriggerTime,
                    {"5", "80", "5", "80", "5", "80", "5"})  // of acquisition in turns
       }) {
    const Outcome outcome = imported(import_objects(whole));
    EXPECT_EQ(outcome.volume.dims[2], 7);
  }
}

// Titles go into answers, which are UTF-8.
TEST(DicomVolumes, HaveTitlesThatCanBeRead) {
  const Outcome outcome =
      import_objects(several([](DicomObject& object, std::uint32_t volume, std::uint32_t) {
        object.text(kImageType, "CS", std::string(70, '\xE4') + "ABC"[volume]);
        object.text(kEchoNumbers, "IS", std::string(volume + 1, '\xE4'));
      }));
  ASSERT_EQ(outcome.remedy.choices.size(), 3);
  EXPECT_EQ(outcome.remedy.choices[1].title, "EchoNumbers ää, 6 slices");
}

TEST(DicomVolumes, AreToldApartByTwoAttributes) {
  const DicomSeries series;
  NamedFiles files;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    for (int each = 0; each < 4; ++each) {
      files.emplace_back("F" + std::to_string(files.size()),
                         series.slice(k)
                             .text(kEchoTime, "DS", each % 2 == 0 ? "5" : "9")
                             .text(kInversionTime, "DS", each < 2 ? "100" : "700")
                             .file());
    }
  }
  const Outcome outcome = import_objects(files);
  EXPECT_THAT(outcome.error, HasSubstr("4 volumes that differ in EchoTime and InversionTime"));
  EXPECT_EQ(outcome.remedy.choices.at(1).title, "EchoTime 5, InversionTime 700, 6 slices");
  EXPECT_EQ(import_objects(files, {.volume = 3}).error, "");
}

TEST(DicomVolumes, AreToldApartByTheOrderOfAcquisition) {
  const auto numbered = [](const std::function<std::uint32_t(std::uint32_t, std::uint32_t)>& by) {
    return several([by](DicomObject& object, std::uint32_t volume, std::uint32_t slice) {
      object.text(kInstanceNumber, "IS", std::to_string(by(volume, slice)));
    });
  };
  const NamedFiles one_after_the_other =
      numbered([](std::uint32_t volume, std::uint32_t slice) { return volume * 6 + slice + 1; });
  EXPECT_THAT(import_objects(one_after_the_other).error, HasSubstr("order of acquisition"));
  expect_all_volumes(one_after_the_other);
  expect_all_volumes(
      numbered([](std::uint32_t volume, std::uint32_t slice) { return slice * 3 + volume + 1; }));
  const NamedFiles without_order = numbered([](std::uint32_t volume, std::uint32_t slice) {
    const bool is_swapped = volume == slice && volume < 2;
    return is_swapped ? 7 - volume * 7 : volume * 6 + slice;
  });
  const Outcome refused = import_objects(without_order);
  EXPECT_THAT(refused.error, HasSubstr("3 slices at each of its 6 positions"));
  EXPECT_TRUE(refused.remedy.choices.empty());
}

TEST(DicomVolumes, OfSeveralFramesAreOneAnObject) {
  const DicomSeries series;
  NamedFiles files;
  for (int number = 1; number <= 2; ++number) {
    files.emplace_back(
        "E" + std::to_string(number),
        series.enhanced({0, 1, 2, 3}).text(kInstanceNumber, "IS", std::to_string(number)).file());
  }
  EXPECT_THAT(import_objects(files).error, HasSubstr("2 volumes that differ in InstanceNumber"));
  EXPECT_EQ(import_objects(files, {.volume = 1}).volume.dims[2], 4);
}

TEST(DicomVolumes, ThatWereBrokenOffAreNotTaken) {
  NamedFiles files = with_echoes();
  files.pop_back();  // the last slice of the third echo
  const Outcome outcome = import_objects(files);
  EXPECT_EQ(outcome.remedy.choices.at(2).title, "EchoTime 100, 5 slices of 6");
  EXPECT_EQ(import_objects(files, {.volume = 1}).error, "");
  EXPECT_THAT(import_objects(files, {.volume = 2}).error,
              HasSubstr("is incomplete: it has 5 of 6 slices"));
}

TEST(DicomVolumes, OfOtherOrientationsAreOffered) {
  const DicomSeries axial;
  const DicomSeries coronal = {.slices = 4, .along_column = {0, 0, -1}, .step = {0, 3, 0}};
  NamedFiles files = axial.files();
  const NamedFiles others = changed(coronal, [](DicomObject& object, std::uint32_t k) {
    object.text(kSopInstanceUid, "UI", "1.9." + std::to_string(k));
  });
  for (const auto& [name, file] : others) files.emplace_back("C" + name, file);
  const Outcome outcome = import_objects(files);
  EXPECT_THAT(
      outcome.remedy.choices,
      ElementsAre(
          Choice{"volume", "0", "6 slices of 5 x 4 samples with normal (0, 0, 1), 0.75 x 0.5 mm"},
          Choice{"volume", "1", "4 slices of 5 x 4 samples with normal (0, 1, 0), 0.75 x 0.5 mm"}));
  EXPECT_EQ(import_objects(files, {.volume = 1}).volume.dims[2], 4);
}

TEST(DicomVolumes, ThatAreAloneNeedNoChoice) {
  EXPECT_EQ(import_objects(DicomSeries{}.files(), {.volume = 0}).error, "");
  EXPECT_THAT(import_objects(DicomSeries{}.files(), {.volume = 1}).error,
              HasSubstr("holds 1 volume. It has no volume 1"));
}

// --- Frames of reference -------------------------------------------------------------------------

NamedFiles with_frames_of_reference(const std::function<std::string(std::uint32_t)>& uid) {
  return changed(DicomSeries{}, [&](DicomObject& object, std::uint32_t k) {
    object.text(kFrameOfReferenceUid, "UI", uid(k));
  });
}

std::string one_each(std::uint32_t slice) {
  return slice == 2 ? "" : "1.2." + std::to_string(slice + 1);
}

std::string in_groups(std::uint32_t slice) { return slice < 3 ? "1.2.1" : "1.2.2"; }

TEST(DicomFramesOfReference, OfEachSliceAreNoted) {
  const Outcome outcome = imported(import_objects(with_frames_of_reference(one_each)));
  EXPECT_THAT(note_detail(outcome, NoteCode::kFrameOfReference),
              HasSubstr("5 frames of reference"));
  EXPECT_EQ(outcome.volume.dicom->frame_of_reference_uid, "");
}

TEST(DicomFramesOfReference, ThatFormGroupsMayBeAccepted) {
  const NamedFiles files = with_frames_of_reference(in_groups);
  const Outcome refused = import_objects(files);
  EXPECT_EQ(refused.code, ErrorCode::kUnusableVolume);
  EXPECT_EQ(refused.remedy.overridable, "frame-of-reference");
  EXPECT_THAT(refused.error, HasSubstr("2 frames of reference"));
  const Outcome accepted = imported(import_objects(files, {.accept = {"frame-of-reference"}}));
  EXPECT_THAT(note_detail(accepted, NoteCode::kFrameOfReference), HasSubstr("The request accepts"));
}

// Errors of the lattice are never overlooked, and then no override is offered.
TEST(DicomFramesOfReference, DoNotHideWhatIsMissing) {
  for (const auto& uid : {one_each, in_groups}) {
    NamedFiles files = with_frames_of_reference(uid);
    files.erase(files.begin() + 4);
    const Outcome outcome = import_objects(files, {.accept = {"frame-of-reference"}});
    EXPECT_THAT(outcome.error, HasSubstr("slice 5 of 6 is missing"));
    EXPECT_EQ(outcome.remedy.overridable, "");
  }
  EXPECT_EQ(note_detail(import_objects(DicomSeries{}.files()), NoteCode::kFrameOfReference), "");
}

// --- What lies beside a series -------------------------------------------------------------------

TEST(DicomUpload, TakesAFileOnceThatCameTwice) {
  NamedFiles files = DicomSeries{}.files();
  files.emplace_back("copy", files[1].second);
  files.emplace_back("another", files[2].second);
  const Outcome outcome = imported(import_objects(files));
  EXPECT_EQ(outcome.canonical, import_objects(DicomSeries{}.files()).canonical);
  EXPECT_THAT(outcome.volume.ignored,
              ElementsAre(IgnoredObject{"copy", "it is the same as \"IM9\""},
                          IgnoredObject{"another", "it is the same as \"IM10\""}));
  EXPECT_THAT(note_detail(outcome, NoteCode::kDuplicateFile), HasSubstr("2 files are copies"));
  // The same name for another content is no copy.
  files.back().second = DicomSeries{}.slice(2).pixels(std::string(40, '\1'), 2).file();
  EXPECT_THAT(import_objects(files).error, HasSubstr("more than once"));
}

TEST(DicomUpload, LeavesOutRawDataReportsAndPresentations) {
  const std::pair<const char*, const char*> kinds[] = {
      {"66", "it is raw data (modality \"MR\")"},
      {"88.33", "it is a report (modality \"MR\")"},
      {"11.1", "it is a presentation state (modality \"MR\")"},
      {"104.1", "it is an encapsulated document (modality \"MR\")"}};
  for (const auto& [sop_class, reason] : kinds) {
    NamedFiles files = DicomSeries{}.files();
    files.emplace_back(
        "beside", DicomSeries{}
                      .slice(0)
                      .text(kSopClassUid, "UI", std::string("1.2.840.10008.5.1.4.1.1.") + sop_class)
                      .text(kModality, "CS", "MR")
                      .erase(kPhotometricInterpretation)
                      .file());
    const Outcome outcome = imported(import_objects(files));
    EXPECT_THAT(outcome.volume.ignored, ElementsAre(IgnoredObject{"beside", reason}));
  }
}

TEST(DicomUpload, NamesASeriesWithoutUidByItsNumber) {
  NamedFiles files = DicomSeries{}.files();
  const NamedFiles others = changed({.slices = 3}, [](DicomObject& object) {
    object.erase(kSeriesInstanceUid)
        .text(kSeriesNumber, "IS", "3")
        .text(kSeriesDescription, "LO", "neck");
  });
  for (const auto& [name, file] : others) files.emplace_back("N" + name, file);
  const Outcome all = import_objects(files);
  EXPECT_THAT(all.remedy.choices, ElementsAre(IsChoice("series", "1.2.3.4", "CT, 6 slices"),
                                              IsChoice("series", "3.0", "neck, CT, 3 slices")));
  EXPECT_THAT(all.error, HasSubstr("neck, CT, 3 slices (3.0)"));
  EXPECT_EQ(import_objects(files, {.series = "3.0"}).volume.dims[2], 3);
}

TEST(DicomUpload, NamesTheOneThatDiffersWhereverItComes) {
  for (const std::size_t odd : {0U, 3U}) {
    const NamedFiles files = changed(DicomSeries{}, [&](DicomObject& object, std::uint32_t k) {
      if (k == odd) object.text(kPixelSpacing, "DS", "0.5\\0.8");
    });
    EXPECT_THAT(import_objects(files).error,
                AllOf(HasSubstr("1 of its 6 slices differs in pixel spacing"),
                      HasSubstr("\"IM" + std::to_string(odd + 1) + "\" differs from")));
  }
}

// The last instant of a series has only every other slice.
NamedFiles interrupted(Tag attribute, std::string_view vr) {
  NamedFiles files;
  const DicomSeries series;
  for (std::uint32_t instant = 1; instant <= 2; ++instant) {
    for (std::uint32_t k = 0; k < series.slices; k += instant) {
      const std::string name = std::to_string(instant * 100 + k);
      files.emplace_back("F" + name, series.slice(k)
                                         .text(attribute, vr, std::to_string(instant))
                                         .text(kSopInstanceUid, "UI", "1.2." + name)
                                         .erase(kInstanceNumber)
                                         .file());
    }
  }
  return files;
}

TEST(DicomVolumes, OffersWhatIsWholeOfAnInterruptedSeries) {
  const NamedFiles files = interrupted(kTemporalPositionIdentifier, "IS");
  const Outcome all = import_objects(files);
  EXPECT_THAT(all.remedy.choices,
              ElementsAre(Choice{"volume", "0", "TemporalPositionIdentifier 1, 6 slices"},
                          Choice{"volume", "1", "TemporalPositionIdentifier 2, 3 slices of 6"}));
  EXPECT_EQ(import_objects(files, {.volume = 0}).volume.dims[2], 6);
  EXPECT_THAT(import_objects(files, {.volume = 1}).error, HasSubstr("incomplete"));
  // Slices that were taken twice are not an instant. Here they have the same samples.
  EXPECT_THAT(note_detail(imported(import_objects(interrupted(kContentTime, "TM"))),
                          NoteCode::kDuplicateSlice),
              HasSubstr("3 slices were left out"));
}

TEST(DicomVolumes, AreNamedByTheirInstancesIfNothingElseDiffers) {
  int number = 0;
  const Outcome all =
      import_objects(several([&](DicomObject& object, std::uint32_t, std::uint32_t) {
        object.text(kInstanceNumber, "IS", std::to_string(++number));
      }));
  ASSERT_EQ(all.remedy.choices.size(), kVolumes) << all.error;
  EXPECT_EQ(all.remedy.choices[1].title, "instances 2 to 17, 6 slices");
}

TEST(DicomUpload, TellsEqualSeriesApartByTheirNumbers) {
  NamedFiles files;
  for (int copy = 1; copy <= 2; ++copy) {
    const DicomSeries series = {.uid = "1.2." + std::to_string(copy)};
    for (std::uint32_t k = 0; k < series.slices; ++k) {
      const std::string name = std::to_string(copy * 10 + int(k));
      files.emplace_back("F" + name, series.slice(k)
                                         .text(kSeriesNumber, "IS", std::to_string(copy))
                                         .text(kSopInstanceUid, "UI", "1.2." + name)
                                         .file());
    }
  }
  EXPECT_THAT(import_objects(files).remedy.choices,
              ElementsAre(IsChoice("series", "1.2.1", "CT, 6 slices, series 1"),
                          IsChoice("series", "1.2.2", "CT, 6 slices, series 2")));
}

TEST(DicomUpload, OfOneSliceSaysThatItIsOne) {
  DicomObject object = DicomSeries{}.slice(0);
  object.erase(kImagePosition).erase(kImageOrientation);
  EXPECT_THAT(
      import_objects({{"one", object.file()}}).error,
      AllOf(HasSubstr("1 slice"), HasSubstr("position (0020,0032)"), Not(HasSubstr("frames"))));
}

}  // namespace
}  // namespace isomesh::import::test
