#include "server/import/message/import_message.h"

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::import {
namespace {

using std::chrono::seconds;

TEST(ImportMessage, AnOrderComesAsItWent) {
  ImportOrder order;
  order.task = {
      .source = "/a/\"b\"\n", .scratch = "/s", .target = "/s/t", .options = {}, .limits = {7}};
  order.task.options.series = "1.2.3";
  order.task.options.member = "a/b.nrrd";
  order.task.options.volume = 3;
  order.task.options.accept = {"frame-of-reference"};
  order.task.options.nifti_form = NiftiForm::kQform;
  order.task.options.spacing = {0.5, 1, 2};
  order.bounds = {.memory_bytes = 8, .time = seconds(9)};
  order.task.options.raw = RawDescription{.dims = {1, 2, 4294967295},
                                          .type = SampleType::kFloat64,
                                          .geometry = {.origin = {0.1, -1e300, 5e-324},
                                                       .spacing = {1.0 / 3, 2, 3},
                                                       .direction = {0, 1, 0, 1, 0, 0, 0, 0, -1}},
                                          .big_endian = true};
  order.task.options.peers = PeersSeries{"multipart/related; boundary=b", "1.2", "1.3", {"1.4"}};
  const auto read = std::get<ImportOrder>(order_from(to_message(order)));
  ASSERT_TRUE(read.task.options.peers);
  EXPECT_EQ(read.task.options.peers->content_type, "multipart/related; boundary=b");
  EXPECT_EQ(read.task.options.peers->study, "1.2");
  EXPECT_EQ(read.task.options.peers->series, "1.3");
  EXPECT_EQ(read.task.options.peers->instances, std::vector<std::string>{"1.4"});
  EXPECT_EQ(read.task.source, order.task.source);
  EXPECT_EQ(read.task.scratch, order.task.scratch);
  EXPECT_EQ(read.task.target, order.task.target);
  EXPECT_EQ(read.task.limits.max_sample_bytes, 7U);
  EXPECT_EQ(read.task.options.series, "1.2.3");
  EXPECT_EQ(read.task.options.member, "a/b.nrrd");
  EXPECT_EQ(read.task.options.volume, 3U);
  EXPECT_TRUE(read.task.options.accepts(NoteCode::kFrameOfReference));
  EXPECT_EQ(read.task.options.nifti_form, NiftiForm::kQform);
  EXPECT_EQ(read.task.options.spacing, (std::array<double, 3>{0.5, 1, 2}));
  EXPECT_EQ(read.bounds.memory_bytes, 8U);
  EXPECT_EQ(read.bounds.time, seconds(9));
  ASSERT_TRUE(read.task.options.raw);
  EXPECT_EQ(read.task.options.raw->dims, order.task.options.raw->dims);
  EXPECT_EQ(read.task.options.raw->type, SampleType::kFloat64);
  EXPECT_EQ(read.task.options.raw->geometry, order.task.options.raw->geometry);
  EXPECT_TRUE(read.task.options.raw->big_endian);
}

TEST(ImportMessage, AnOrderToReadAnAnswerComesAsItWent) {
  const auto read = std::get<ResponseOrder>(
      order_from(to_message(ResponseOrder{{"/a/b"}, {.memory_bytes = 8, .time = seconds(9)}})));
  EXPECT_EQ(read.task.source, "/a/b");
  EXPECT_EQ(read.bounds.memory_bytes, 8U);
  EXPECT_EQ(read.bounds.time, seconds(9));
}

TEST(ImportMessage, AnAnswerComesAsItWent) {
  PeersResponse answer;
  answer.objects = {{.study = "1.2",
                     .series = "1.3",
                     .instance = "1.4",
                     .patient_id = "ÄÖ\"\\",
                     .modality = "CT",
                     .series_description = "head",
                     .instances = 54}};
  answer.stored = {{.instance = "1.5"}};
  answer.failed = {{.instance = "1.6", .failure = 0xA700}};
  const ImportReport report = report_from(begun_message() + response_message(answer));
  ASSERT_TRUE(report.response);
  EXPECT_EQ(*report.response, answer);
}

// They go into addresses of further requests.
TEST(ImportMessage, AUidThatIsNoneIsRefused) {
  for (const char* uid : {"../../x", "1.2/../3", "1..2", "1 2", "1.2?x=1"}) {
    PeersResponse answer;
    answer.objects = {{.series = uid}};
    EXPECT_EQ(test::code_thrown_by([&] { report_from(response_message(answer)); }),
              ErrorCode::kInternal)
        << uid;
  }
}

TEST(ImportMessage, AReportHasWhatWasSaid) {
  const Remedy remedy = {.overridable = "frame-of-reference",
                         .choices = {{"series", "1.2", "head"}, {"series", "1.3", "scout"}}};
  const Error refusal =
      Error(ErrorCode::kUnusableVolume, "two \"series\"", {{"series", "1.2"}}).with_remedy(remedy);
  const ImportReport report = report_from(reading_message("archive") + reading_message("dicom") +
                                          error_message(refusal) + "{\"read");
  EXPECT_EQ(report.reading, "dicom");
  EXPECT_FALSE(report.volume);
  ASSERT_TRUE(report.error);
  EXPECT_EQ(report.error->code(), ErrorCode::kUnusableVolume);
  EXPECT_STREQ(report.error->what(), "two \"series\"");
  EXPECT_EQ(report.error->fields(), refusal.fields());
  EXPECT_EQ(report.error->remedy(), remedy);
}

TEST(ImportMessage, AVolumeComesWithItsLabels) {
  Volume volume;
  volume.id = "ab";
  volume.format = "nifti";
  volume.dims = {2, 3, 4};
  volume.labels = {{.label = 3, .name = "liver"}};
  volume.dicom.emplace().modality = "CT";
  const ImportReport report = report_from(volume_message(volume));
  ASSERT_TRUE(report.volume);
  EXPECT_EQ(*report.volume, volume);
}

// The process that reports may have been taken over by what it read.
TEST(ImportMessage, AReportOfAnotherFormIsRefused) {
  for (const std::string line :
       {"", "7", "[]", R"({"begun":"yes"})", R"({"reading":7})", R"({"reading":"[error] forged"})",
        R"({"volume":{}})", R"({"volume":[]})", R"({"error":7})", R"({"response":{"objects":[]}})",
        R"({"response":{"objects":[{}],"stored":[],"failed":[]}})"}) {
    EXPECT_EQ(test::code_thrown_by([&] { report_from(line + '\n'); }), ErrorCode::kInternal)
        << line;
  }
}

}  // namespace
}  // namespace isomesh::import
