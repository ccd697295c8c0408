#include "server/process/import_message.h"

#include <gtest/gtest.h>

namespace isomesh::process {
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
  order.bounds = {.memory_bytes = 8, .time = seconds(9)};
  order.task.options.raw = RawDescription{.dims = {1, 2, 4294967295},
                                          .type = SampleType::kFloat64,
                                          .geometry = {.origin = {0.1, -1e300, 5e-324},
                                                       .spacing = {1.0 / 3, 2, 3},
                                                       .direction = {0, 1, 0, 1, 0, 0, 0, 0, -1}},
                                          .big_endian = true};
  const ImportOrder read = order_from(to_message(order));
  EXPECT_EQ(read.task.source, order.task.source);
  EXPECT_EQ(read.task.scratch, order.task.scratch);
  EXPECT_EQ(read.task.target, order.task.target);
  EXPECT_EQ(read.task.limits.max_sample_bytes, 7U);
  EXPECT_EQ(read.task.options.series, "1.2.3");
  EXPECT_EQ(read.task.options.member, "a/b.nrrd");
  EXPECT_EQ(read.task.options.volume, 3U);
  EXPECT_TRUE(read.task.options.accepts(NoteCode::kFrameOfReference));
  EXPECT_EQ(read.task.options.nifti_form, NiftiForm::kQform);
  EXPECT_EQ(read.bounds.memory_bytes, 8U);
  EXPECT_EQ(read.bounds.time, seconds(9));
  ASSERT_TRUE(read.task.options.raw);
  EXPECT_EQ(read.task.options.raw->dims, order.task.options.raw->dims);
  EXPECT_EQ(read.task.options.raw->type, SampleType::kFloat64);
  EXPECT_EQ(read.task.options.raw->geometry, order.task.options.raw->geometry);
  EXPECT_TRUE(read.task.options.raw->big_endian);
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

}  // namespace
}  // namespace isomesh::process
