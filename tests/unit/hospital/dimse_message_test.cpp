#include <gtest/gtest.h>

#include "server/hospital/dimse/message.h"
#include "tests/support/errors.h"

namespace isomesh::dimse {
namespace {

TEST(DimseMessage, OrdersComeBack) {
  const DimseSending sending = {.calling = "ISOMESH",
                                .called = "PACS \"1\"",
                                .file = "/data/blobs/ab",
                                .sop_class = "1.2",
                                .instance = "1.3",
                                .timeout = std::chrono::seconds(7),
                                .response_timeout = std::chrono::seconds(8)};
  EXPECT_EQ(dimse_order_from(to_line(DimseOrder(sending))), DimseOrder(sending));
  const DimseReceiving receiving = {.called = {"BONE", "SKIN"},
                                    .calling = {"CT1"},
                                    .folder = "/data/scratch/x",
                                    .max_object_bytes = 1234,
                                    .idle = std::chrono::seconds(9)};
  EXPECT_EQ(dimse_order_from(to_line(DimseOrder(receiving))), DimseOrder(receiving));
}

TEST(DimseMessage, ReportsComeBack) {
  for (const DimseReport& report :
       {DimseReport(DimseSent{DimseEnd::kResponded, 0xA700}),
        DimseReport(DimseObject{"12", "BONE", "CT1", "1.2", "1.3", "1.4"}),
        DimseReport(DimseEnded{DimseRefusal::kOther, "", ""}),
        DimseReport(DimseEnded{DimseRefusal::kCalling, "BONE", "CT1"})}) {
    EXPECT_EQ(dimse_report_from(to_line(report)), report);
  }
}

// The process that reports may have been taken over by what it read.
TEST(DimseMessage, ReportsThatWouldDoHarmAreRefused) {
  EXPECT_ANY_THROW(
      dimse_report_from(to_line(DimseReport(DimseEnded{DimseRefusal::kCalled, "a\nb", ""}))));
  const DimseObject good = {"12", "BONE", "CT1", "1.2", "1.3", "1.4"};
  std::vector<DimseObject> bad(6, good);
  bad[0].file = "../1";
  bad[1].file = "";
  bad[2].study = "1.2/../3";
  bad[3].series = "";
  bad[4].instance = "x";
  bad[5].calling = "A\\B";
  for (const DimseObject& object : bad) {
    const std::string line = to_line(DimseReport(object));
    const Error error = test::error_of([&] { dimse_report_from(line); }, line);
    EXPECT_EQ(error.code(), ErrorCode::kInternal);
  }
  for (const char* line :
       {"", "{}", "[]", R"({"sent":{"end":8,"status":0}})", R"({"sent":{"end":0,"status":-1}})",
        R"({"sent":{"end":0,"status":65536}})", R"({"sent":{"end":-1,"status":0}})",
        R"({"sent":{"end":0}})", R"({"sent":{"end":0,"status":1.5}})", R"({"ended":{"refusal":4}})",
        R"({"ended":{"refusal":"x"}})"}) {
    EXPECT_TRUE(test::thrown_by([&] { dimse_report_from(line); })) << line;
  }
}

TEST(DimseMessage, TitlesAreThoseOfDicom) {
  for (const char* good : {"A", "CT 1", "0123456789ABCDEF"}) EXPECT_TRUE(is_ae_title(good));
  for (const char* bad : {"", " A", "A ", "A\\B", "0123456789ABCDEFG", "A\n", "\xC3\xA4"}) {
    EXPECT_FALSE(is_ae_title(bad)) << bad;
  }
}

}  // namespace
}  // namespace isomesh::dimse
