#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/dicom_uid.h"
#include "server/hospital/objects/data_set.h"
#include "server/hospital/objects/encapsulated_document.h"
#include "server/hospital/objects/uid.h"
#include "tests/support/errors.h"

namespace isomesh::dicom {
namespace {

using testing::HasSubstr;
using testing::Not;

// The one by which objects of former versions are found again: it never changes.
TEST(NameBasedUid, IsTheUuidOfTheName) {
  EXPECT_EQ(name_based_uid("implementation"), "2.25.279211165198872987576824021603170251525");
}

TEST(NameBasedUid, OfAnotherNameIsAnother) {
  EXPECT_EQ(name_based_uid("a"), name_based_uid("a"));
  EXPECT_NE(name_based_uid("a"), name_based_uid("b"));
  for (int number = 0; number < 200; ++number) {
    EXPECT_TRUE(is_uid(name_based_uid(std::to_string(number))));
  }
}

TEST(DataSet, WritesElementsByTheirTags) {
  DataSet data;
  data.set(0x00100010, "PN", "abc");
  data.set(0x00080018, "UI", "1.2");
  data.set_told(0x00081030, "LO", "");
  EXPECT_EQ(data.bytes(), std::string("\x08\0\x18\0UI\4\0"
                                      "1.2\0\x10\0\x10\0PN\4\0abc ",
                                      24));
}

TEST(DataSet, WritesSequencesWithTheirLengths) {
  DataSet item;
  item.set(0x00080100, "SH", "ab");
  DataSet data;
  data.set_sequence(0x00082218, {item, DataSet()});
  EXPECT_EQ(data.bytes(), std::string("\x08\0\x18\x22SQ\0\0\x1A\0\0\0"
                                      "\xFE\xFF\0\xE0\x0A\0\0\0\x08\0\0\1SH\2\0ab"
                                      "\xFE\xFF\0\xE0\0\0\0\0",
                                      38));
}

TEST(DataSet, IsCutAtATag) {
  DataSet data;
  data.set(0x00100010, "PN", "a");
  data.set(0x00420011, "OB", "bb");
  data.set(0x00687001, "CS", "NO");
  EXPECT_EQ(data.bytes_before(0x00420011) + element_head(0x00420011, "OB", 2) + "bb" +
                data.bytes_after(0x00420011),
            data.bytes());
}

// A length that is cut would make the rest of the value look like elements: those of the patient,
// if somebody has written them there.
TEST(DataSet, HasNoValueThatIsTooLongForItsElement) {
  constexpr std::size_t kMost = 65'534;
  DataSet data;
  data.set(0x00081030, "LO", std::string(kMost, 'x'));
  EXPECT_EQ(data.bytes().size(), 8 + kMost);
  data.set(0x00081030, "LO", std::string(kMost + 1, 'x'));
  const Error error = test::error_of([&] { data.bytes(); });
  EXPECT_EQ(error.code(), ErrorCode::kTooLarge);
  EXPECT_THAT(error.what(), HasSubstr("(0008,1030)"));
  data.set(0x00081030, "UT", std::string(kMost + 1, 'x'));
  EXPECT_EQ(data.bytes().size(), 12 + kMost + 2);
}

class EnvelopeTest : public testing::Test {
 protected:
  dicom::Envelope made(std::uint64_t bytes) {
    return make_envelope({.kind = kind_,
                          .common = {.identity = identity_,
                                     .sop_instance_uid = "2.25.2",
                                     .series_uid = "2.25.1",
                                     .series_number = 9001,
                                     .title = "Bone",
                                     .made = {},
                                     .station_name = "here"},
                          .content_description = "iso 1",
                          .algorithm_parameters = "{}",
                          .segment = segment_,
                          .materials_uid = materials_},
                         bytes);
  }

  DicomIdentity identity_ = [] {
    DicomIdentity identity;
    identity.modality = "CT";
    identity.study_uid = "1.2";
    identity.series_uid = "1.3";
    identity.instances = {{"1.4", "1.5"}};
    return identity;
  }();
  std::optional<DicomSegment> segment_;
  DocumentKind kind_ = DocumentKind::kStl;
  std::string materials_;
};

TEST_F(EnvelopeTest, IsEvenHoweverLongTheMesh) {
  for (const std::uint64_t bytes : {84U, 85U}) {
    const dicom::Envelope envelope = made(bytes);
    EXPECT_EQ((envelope.before.size() + bytes + envelope.after.size()) % 2, 0U);
    EXPECT_THAT(envelope.before.substr(128), testing::StartsWith("DICM"));
  }
  EXPECT_EQ(made(85).after.front(), '\0');
}

TEST_F(EnvelopeTest, HoldsWhatAnElementCanHold) {
  EXPECT_NO_THROW(made(kMostDocumentBytes));
  EXPECT_EQ(test::code_thrown_by([&] { made(kMostDocumentBytes + 1); }), ErrorCode::kTooLarge);
}

TEST_F(EnvelopeTest, WithoutAFrameOfReferenceMeshesOfASeriesShareOne) {
  const std::string derived = name_based_uid("frame of reference\n1.2\n1.3");
  EXPECT_THAT(made(84).before, HasSubstr(derived));
  identity_.frame_of_reference_uid = "1.99";
  EXPECT_THAT(made(84).before, Not(HasSubstr(derived)));
}

TEST_F(EnvelopeTest, OfASegmentHasItsCodes) {
  EXPECT_THAT(made(84).before, HasSubstr("85040-4"));
  segment_ = DicomSegment{.label = 1,
                          .category = {},
                          .type = {"10200004", "SCT", "Liver"},
                          .region = {"818983003", "SCT", "Abdomen"}};
  const std::string before = made(84).before;
  EXPECT_THAT(before, HasSubstr("10200004"));
  EXPECT_THAT(before, HasSubstr("818983003"));
  EXPECT_THAT(before, Not(HasSubstr("85040-4")));
}

TEST_F(EnvelopeTest, OfAnObjRefersToItsMaterialsByUidAndName) {
  EXPECT_THAT(made(84).before, Not(HasSubstr("mesh.mtl")));
  kind_ = DocumentKind::kObj;
  materials_ = "2.25.3";
  const Envelope envelope = made(84);
  EXPECT_THAT(envelope.before, HasSubstr("1.2.840.10008.5.1.4.1.1.104.4"));
  EXPECT_THAT(envelope.before, HasSubstr("1.2.840.10008.5.1.4.1.1.104.5"));
  EXPECT_THAT(envelope.before, HasSubstr(std::string("UR\0\0\x08\0\0\0mesh.mtl", 16)));
  EXPECT_THAT(envelope.after, HasSubstr("model/obj"));
}

// A scanner that told nothing is no contributor.
TEST_F(EnvelopeTest, NamesAScannerWhereThereIsOne) {
  EXPECT_THAT(made(84).before, Not(HasSubstr("109101")));
  identity_.equipment.manufacturer = "Maker";
  EXPECT_THAT(made(84).before, HasSubstr("109101"));
}

}  // namespace
}  // namespace isomesh::dicom
