#include <algorithm>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include "server/hospital/dicomweb/dicomweb.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::dicomweb {
namespace {

using std::chrono::steady_clock;
using testing::ElementsAre;
using testing::SizeIs;

// Three studies, of which the second one has two series. Ignores the query, but not the page.
class TellingPacs {
 public:
  TellingPacs() {
    http_.Get("/studies", [this](const httplib::Request& request, httplib::Response& response) {
      asked_ = request.params;
      if (studies.empty()) {
        response.status = 404;
        return;
      }
      std::string page;
      const std::size_t offset = std::stoul(asked("offset"));
      const std::size_t end = std::min(studies.size(), offset + std::stoul(asked("limit")));
      for (std::size_t i = offset; i < end; ++i) page += (page.empty() ? "" : ",") + studies[i];
      response.set_content('[' + page + ']', "application/dicom+json");
    });
    http_.Get("/studies/(.*)/series",
              [](const httplib::Request& request, httplib::Response& response) {
                const std::string study = request.matches[1];
                if (study == "3.2") std::this_thread::sleep_for(std::chrono::seconds(2));
                std::string series = one_series(study + ".1", "scout");
                if (study == "1.2") series += ',' + one_series(study + ".2", std::string(300, 'a'));
                response.set_content('[' + series + ']', "application/dicom+json");
              });
    http_.set_keep_alive_max_count(1);
    port_ = http_.bind_to_any_port("127.0.0.1");
    thread_ = std::jthread([this] { http_.listen_after_bind(); });
    while (!http_.is_running()) std::this_thread::yield();
  }
  ~TellingPacs() { http_.stop(); }
  TellingPacs(const TellingPacs&) = delete;
  TellingPacs& operator=(const TellingPacs&) = delete;

  orders::PacsSettings settings() const {
    orders::PacsSettings settings;
    settings.dicomweb = "http://127.0.0.1:" + std::to_string(port_);
    return settings;
  }
  std::string asked(const std::string& name) const {
    const auto found = asked_.find(name);
    return found == asked_.end() ? "" : found->second;
  }

  static std::string study(const std::string& uid, const std::string& name,
                           const std::string& day = "20261130") {
    return R"({"0020000D": {"vr": "UI", "Value": [")" + uid +
           R"("]}, "00080020": {"vr": "DA", "Value": [")" + day +
           R"("]}, "00100020": {"vr": "LO", "Value": ["P"]}, "00081030": {"vr": "LO", "Value": ["Head"]}, "00100010": {"vr": "PN", "Value": [)" +
           name + "]}}";
  }

  std::vector<std::string> studies = {study("1.1", "\"Roe^Rita\""),
                                      study("1.2", R"({"Ideographic": "名^前", "Phonetic": "x"})"),
                                      study("1.3", R"({"Alphabetic": "Doe^Jane"})")};

 private:
  static std::string one_series(const std::string& uid, const std::string& description) {
    return R"({"0020000E": {"vr": "UI", "Value": [")" + uid +
           R"("]}, "00201209": {"vr": "IS", "Value": [7]}, "0008103E": {"vr": "LO", "Value": [")" +
           description + "\"]}}";
  }

  httplib::Server http_;
  int port_ = 0;
  httplib::Params asked_;
  std::jthread thread_;
};

TEST(SearchOfAPerson, FindsStudiesAndThenTheirSeries) {
  TellingPacs pacs;
  jobs::ImportRunner runner({.bounds = {}, .program = ISOMESH_IMPORT});
  const test::TemporaryFolder folder;
  DicomWeb web(pacs.settings(), folder.path(), 1 << 20, runner);
  const auto search = [&](const SeriesQuery& query) {
    return web.search(query, steady_clock::now() + std::chrono::minutes(1), {});
  };
  const PacsSeriesList all =
      search({.patient_name = "D*e^J&=", .date = "20261101-20261130", .modality = "CT"});
  EXPECT_TRUE(all.complete);
  ASSERT_THAT(all.series, SizeIs(4));
  EXPECT_EQ(all.series[0], (PacsSeries{.study = "1.1",
                                       .series = "1.1.1",
                                       .patient_id = "P",
                                       .patient_name = "Roe^Rita",
                                       .study_date = "20261130",
                                       .study_description = "Head",
                                       .series_description = "scout",
                                       .instances = 7}));
  EXPECT_EQ(all.series[1].patient_name, "名^前");
  EXPECT_EQ(all.series[2].series_description, std::string(256, 'a'));
  EXPECT_EQ(all.series[3].patient_name, "Doe^Jane");
  EXPECT_EQ(pacs.asked("PatientName"), "D*e*J*");
  EXPECT_EQ(pacs.asked("StudyDate"), "20261101-20261130");
  EXPECT_EQ(pacs.asked("ModalitiesInStudy"), "CT");
  EXPECT_EQ(pacs.asked("PatientID"), "");

  const PacsSeriesList two = search({.date = "20261130", .limit = 2});
  EXPECT_FALSE(two.complete);
  EXPECT_THAT(two.series, SizeIs(3));
  // The UID is ignored.
  const PacsSeriesList one = search({.study = "1.3"});
  EXPECT_TRUE(one.complete);
  EXPECT_THAT(one.series, ElementsAre(all.series[3]));
  EXPECT_EQ(test::code_thrown_by([&] { web.search({.study = "1.3"}, steady_clock::now(), {}); }),
            ErrorCode::kPacsUnreachable)
      << "out of time";
  search({.patient_id = "A/12", .patient_name = "名^前"});
  EXPECT_EQ(pacs.asked("PatientID"), "A*12");
  EXPECT_EQ(pacs.asked("PatientName"), "名^前") << "wildcards alone would find everybody";
}

TEST(SearchOfAPerson, ListsTheNewestOfManyStudiesAndTheOneThatWasAskedFor) {
  TellingPacs pacs;
  pacs.studies.clear();
  for (int n = 0; n < 150; ++n) {
    pacs.studies.push_back(
        TellingPacs::study("2." + std::to_string(n), "\"Roe\"", std::to_string(20260000 + n)));
  }
  jobs::ImportRunner runner({.bounds = {}, .program = ISOMESH_IMPORT});
  const test::TemporaryFolder folder;
  DicomWeb web(pacs.settings(), folder.path(), 1 << 20, runner);
  const auto search = [&](const SeriesQuery& query) {
    return web.search(query, steady_clock::now() + std::chrono::minutes(1), {});
  };
  const PacsSeriesList newest = search({.patient_id = "P", .limit = 2});
  EXPECT_FALSE(newest.complete);
  ASSERT_THAT(newest.series, SizeIs(2));
  EXPECT_EQ(newest.series[0].study, "2.149");
  EXPECT_EQ(newest.series[1].study, "2.148");
  const PacsSeriesList day = search({.date = "20260007", .limit = 1});
  EXPECT_TRUE(day.complete) << "the others are not asked for";
  ASSERT_THAT(day.series, SizeIs(1));
  EXPECT_EQ(day.series[0].study, "2.7");
  const PacsSeriesList one = search({.study = "2.140"});
  EXPECT_TRUE(one.complete);
  ASSERT_THAT(one.series, SizeIs(1));
  EXPECT_EQ(one.series[0].study, "2.140");
  pacs.studies.clear();
  const Error error = test::error_of([&] { search({.study = "2.140"}); });
  EXPECT_EQ(error.code(), ErrorCode::kPacsRefused);
  EXPECT_THAT(error.what(), testing::HasSubstr("404"));
}

TEST(SearchOfAPerson, HasWhatWasFoundInItsTime) {
  TellingPacs pacs;
  pacs.studies = {TellingPacs::study("3.1", "\"Roe\""), TellingPacs::study("3.2", "\"Roe\"")};
  jobs::ImportRunner runner({.bounds = {}, .program = ISOMESH_IMPORT});
  const test::TemporaryFolder folder;
  DicomWeb web(pacs.settings(), folder.path(), 1 << 20, runner);
  const PacsSeriesList part =
      web.search({.patient_id = "P"}, steady_clock::now() + std::chrono::milliseconds(1500), {});
  EXPECT_FALSE(part.complete);
  ASSERT_THAT(part.series, SizeIs(1));
  EXPECT_EQ(part.series[0].study, "3.1");
}

// The program misbehaves as the response says.
TEST(Responses, ThatCannotBeReadSayWhy) {
  jobs::ImportRunner runner(
      {.bounds = {.memory_bytes = std::uint64_t{128} << 20, .time = std::chrono::minutes(1)},
       .program = FAULTY_IMPORT});
  const test::TemporaryFolder folder;
  for (const auto& [what, reason] :
       {std::pair<std::string, std::string>{"run out of time",
                                            "reading the response of the PACS took too long"},
        {"crash", "the response of the PACS cannot be read"}}) {
    test::write_file(folder / "response", what);
    const Error error = test::error_of([&] { read_response(runner, folder / "response"); });
    EXPECT_EQ(error.code(), ErrorCode::kPacsUnreachable);
    EXPECT_EQ(error.what(), reason);
  }
}

}  // namespace
}  // namespace isomesh::dicomweb
