// Tests of the responses of a PACS: multipart/related and DICOM JSON.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/peers/multipart.h"
#include "server/import/peers/response.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/step.h"

namespace isomesh::import {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class Multipart : public testing::Test {
 protected:
  std::vector<std::string> parts_of(const std::string& bytes, const std::string& boundary = "b",
                                    const MultipartLimits& limits = {.max_bytes = 1 << 24,
                                                                     .max_parts = 9}) {
    const test::TemporaryFolder folder;
    test::write_file(folder / "file", bytes);
    std::filesystem::create_directory(folder / "parts");
    std::vector<std::string> parts;
    for (const auto& part : unpack_multipart(folder / "file", boundary, folder / "parts", limits)) {
      parts.push_back(test::read_file(part));
    }
    return parts;
  }
  std::optional<ErrorCode> refusal_of(const std::string& bytes) {
    return test::code_thrown_by([&] { parts_of(bytes); });
  }

  const std::string whole_ =
      "preamble\r\n--b\r\nContent-Type: application/dicom\r\nX: y\r\n\r\none\r\n--b\r\n\r\ntwo\r\n"
      "\r\n--b--\r\nepilogue";
};

TEST_F(Multipart, IsUnpacked) {
  EXPECT_THAT(parts_of(whole_), ElementsAre("one", "two\r\n"));
  EXPECT_THAT(parts_of("--b\r\n\r\none\r\n--b--"), ElementsAre("one"));
  EXPECT_THAT(parts_of("--b--"), IsEmpty());
  EXPECT_THAT(parts_of("--b \r\n\r\n\r\n--b--"), ElementsAre(""));
}

TEST_F(Multipart, IsUnpackedThoughLinesEndWithLineFeedsAlone) {
  EXPECT_THAT(parts_of("preamble\n--b\nX: y\n\none\r\n--b\n\ntwo\n\n--b--\n"),
              ElementsAre("one\r", "two\n"));
  EXPECT_THAT(parts_of("--b\n\none\n--b--"), ElementsAre("one"));
  const std::string whole = "--b\nX: y\n\none\n--b\n\ntwo\n--b--";
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_EQ(refusal_of(whole.substr(0, length)), ErrorCode::kSeriesIncomplete) << length;
  }
}

// Whatever is missing at its end, nothing is taken for the whole.
TEST_F(Multipart, CutAnywhereIsRefused) {
  const std::size_t closed = whole_.find("--b--") + 5;
  for (std::size_t length = 0; length < closed; ++length) {
    EXPECT_EQ(refusal_of(whole_.substr(0, length)), ErrorCode::kSeriesIncomplete) << length;
  }
  EXPECT_FALSE(refusal_of(whole_.substr(0, closed)));
}

// Boundaries may lie across the pieces in which the file is read.
TEST_F(Multipart, PartsOfAnyLengthComeWhole) {
  constexpr std::size_t kPiece = std::size_t{1} << 20;
  for (std::size_t length = kPiece - 40; length < kPiece + 8; length += test::kStep) {
    std::string content(length, 'x');
    content += "\r\n--";  // nearly a boundary
    const std::string bytes = "--b\r\n\r\n" + content + "\r\n--b\r\n\r\n2\r\n--b--";
    ASSERT_THAT(parts_of(bytes), ElementsAre(content, "2")) << length;
  }
}

TEST_F(Multipart, IsBounded) {
  const std::string bytes = "--b\r\n\r\n12345\r\n--b\r\n\r\n12345\r\n--b--";
  for (const MultipartLimits& limits : {MultipartLimits{9, 9}, MultipartLimits{99, 1}}) {
    EXPECT_EQ(test::code_thrown_by([&] { parts_of(bytes, "b", limits); }), ErrorCode::kTooLarge);
  }
  EXPECT_EQ(refusal_of("--b\r\n" + std::string(200'000, 'h') + "\r\nx: y\r\n\r\n1\r\n--b--"),
            ErrorCode::kSeriesIncomplete);
}

TEST(Boundary, IsThatOfTheContentType) {
  EXPECT_EQ(boundary_of("multipart/related; type=\"application/dicom\"; boundary=a-b"), "a-b");
  EXPECT_EQ(boundary_of("Multipart/Related; Boundary=\"a; b\"; type=x"), "a; b");
  EXPECT_EQ(boundary_of("multipart/related; boundary = a ; type=x"), "a");
  EXPECT_EQ(boundary_of("multipart/related;boundary\t=\t\"a b\""), "a b");
  EXPECT_EQ(boundary_of(R"(multipart/related; type="x; boundary=y"; boundary="a\"b")"), "a\"b");
  EXPECT_EQ(boundary_of("multipart/related; x-boundary=1; y; boundary=2;"), "2");
  const std::string long_one = "multipart/related; boundary=" + std::string(71, 'b');
  // The PACS will not send anything else, so no retry helps.
  for (const std::string type :
       {"multipart/related", "multipart/related; boundary=", "multipart/related; boundary",
        "multipart/related; boundary=\"\"", "multipart/related; boundary =", "application/zip",
        "application/dicom+json", "image/jpeg", long_one.c_str()}) {
    EXPECT_EQ(test::code_thrown_by([&] { boundary_of(type); }), ErrorCode::kUnusableVolume) << type;
  }
  for (const std::string type : {"", "text/plain; boundary=b", "text/html"}) {
    EXPECT_EQ(test::code_thrown_by([&] { boundary_of(type); }), ErrorCode::kSeriesIncomplete)
        << type;
  }
  EXPECT_TRUE(is_single_dicom("Application/DICOM ; transfer-syntax=*"));
  EXPECT_FALSE(is_single_dicom("application/dicom+json"));
}

PeersResponse answer_of(const std::string& text) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "answer", text);
  return read_response(folder / "answer");
}

TEST(Answer, OfASearchIsAListOfObjects) {
  const auto answer = answer_of(R"([
    {"0020000D": {"vr": "UI", "Value": ["1.2"]}, "0020000E": {"vr": "UI", "Value": ["1.3"]},
     "00080018": {"vr": "UI", "Value": ["1.4"]}, "00100020": {"vr": "LO", "Value": ["P"]},
     "00080060": {"vr": "CS", "Value": ["CT"]}, "0008103E": {"vr": "LO", "Value": ["head"]},
     "00080020": {"vr": "DA", "Value": ["20261130"]}, "00081030": {"vr": "LO", "Value": ["neuro"]},
     "00100010": {"vr": "PN", "Value": [{"Alphabetic": "", "Ideographic": " 名^前 "}]},
     "00201209": {"vr": "IS", "Value": [54]}},
    {"00201209": {"vr": "IS", "Value": ["54"]}}, {"00201209": {"vr": "IS"}}, {}])");
  ASSERT_EQ(answer.objects.size(), 4U);
  EXPECT_EQ(answer.objects[0], (PeersObject{.study = "1.2",
                                            .series = "1.3",
                                            .instance = "1.4",
                                            .patient_id = "P",
                                            .patient_name = "名^前",
                                            .study_date = "20261130",
                                            .study_description = "neuro",
                                            .modality = "CT",
                                            .series_description = "head",
                                            .instances = 54}));
  EXPECT_EQ(answer.objects[1].instances, 54U);
  EXPECT_FALSE(answer.objects[2].instances);
  EXPECT_EQ(answer.objects[3], PeersObject());
  // A long text is cut between characters.
  const auto cut =
      answer_of(R"([{"0008103E": {"Value": ["x)" + std::string(1022, 'x') + R"(名"]}}])");
  EXPECT_EQ(cut.objects.at(0).series_description, std::string(1023, 'x'));
  EXPECT_THAT(answer_of("").objects, IsEmpty());
  EXPECT_THAT(answer_of("[]").objects, IsEmpty());
}

TEST(Answer, OfAWorklistTellsInputsAndProcedures) {
  const std::string input = R"({"0020000D": {"Value": ["1.2"]}, "0020000E": {"Value": ["1.3"]}})";
  const auto item = [&](const std::string& inputs) {
    return answer_of(R"({"00080018": {"Value": ["1.1"]}, "00741000": {"Value": ["SCHEDULED"]},
      "0020000D": {"Value": ["1.9"]}, "00404041": {"Value": ["READY"]},
      "00404018": {"Value": [{"00080100": {"Value": ["M^1"]}, "00080102": {"Value": ["99X"]}}, 7]},
      "00404021": {"Value": [)" +
                     inputs + "]}}")
        .objects.at(0);
  };
  const PeersObject found = item(input);
  EXPECT_EQ(found.instance, "1.1");
  EXPECT_EQ(found.workitem_state, "SCHEDULED");
  EXPECT_EQ(found.readiness, "READY");
  EXPECT_EQ(found.study, "1.2");
  EXPECT_EQ(found.series, "1.3");
  EXPECT_THAT(found.procedures, ElementsAre("M 1^99X^"));
  for (const std::string& other : {std::string(), input + ", " + input, std::string("{}")}) {
    EXPECT_EQ(item(other).study, "") << other;
  }
}

TEST(Answer, OfMetadataTellsTheSegmentedSeries) {
  const std::string series = R"({"0020000E": {"Value": ["1.3"]}})";
  const auto segmented = [](const std::string& items) {
    return answer_of(R"([{"00081115": {"Value": [)" + items + "]}}]")
        .objects.at(0)
        .segmented_series;
  };
  EXPECT_EQ(segmented(series), "1.3");
  EXPECT_EQ(segmented(series + ", " + series), "");
  EXPECT_EQ(segmented(""), "");
}

// Values of images are read without these spaces, too, and both are compared.
TEST(Answer, IsWithoutSpacesAroundValues) {
  const auto answer = answer_of(
      R"([{"00100020": {"vr": "LO", "Value": [" P 7 "]}, "0008103E": {"Value": [" head  "]}}])");
  ASSERT_EQ(answer.objects.size(), 1U);
  EXPECT_EQ(answer.objects[0].patient_id, "P 7");
  EXPECT_EQ(answer.objects[0].series_description, "head");
}

TEST(Answer, OfStoringTellsWhatWasStored) {
  const auto answer = answer_of(R"({
    "00081199": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": ["1.5"]}}]},
    "00081198": {"vr": "SQ", "Value": [{"00081155": {"vr": "UI", "Value": ["1.6"]},
                                        "00081197": {"vr": "US", "Value": [42752]}}]}})");
  EXPECT_THAT(answer.stored, ElementsAre(PeersObject{.instance = "1.5"}));
  EXPECT_THAT(answer.failed, ElementsAre(PeersObject{.instance = "1.6", .failure = 0xA700}));
}

TEST(Answer, ThatIsNoneIsRefused) {
  for (const char* text :
       {"<html>", "1", "\"x\"", "null", "[1]", "[[]]", "[", "{\"00081199\": {\"Value\": [1]}}",
        R"([{"0020000E": {"Value": ["../../secrets"]}}])"}) {
    EXPECT_EQ(test::code_thrown_by([&] { answer_of(text); }), ErrorCode::kInvalidParameter) << text;
  }
  const std::string nothing = "[]";
  EXPECT_FALSE(test::code_thrown_by([&] { answer_of(nothing); }));
  EXPECT_EQ(test::code_thrown_by([&] { answer_of(nothing + '\0' + nothing); }),
            ErrorCode::kInvalidParameter);
  // As deep as it may be, it is refused like the others and ends nothing.
  EXPECT_TRUE(test::code_thrown_by([] { answer_of(std::string(2'000'000 / test::kStep, '[')); }));
}

TEST(Answer, OfStrangeKindsTellsNothing) {
  const auto answer = answer_of(
      R"([{"0020000D": 1, "0020000E": {"Value": 1}, "00080018": {"Value": []},
           "00100020": {"Value": [7]}, "00201209": {"Value": [-1]}},
          {"00201209": {"Value": [1e99]}}])");
  EXPECT_THAT(answer.objects, ElementsAre(PeersObject(), PeersObject()));
}

}  // namespace
}  // namespace isomesh::import
