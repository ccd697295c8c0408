#include <string>
#include <thread>
#include <utility>

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

// Three studies, of which the second one has two series.
class TellingPacs {
 public:
  TellingPacs() {
    http_.Get("/studies", [this](const httplib::Request& request, httplib::Response& response) {
      asked_ = request.params;
      response.set_content(study("1.1", "\"Roe^Rita\"") + ',' +
                               study("1.2", R"({"Ideographic": "名^前", "Phonetic": "x"})") + ',' +
                               study("1.3", R"({"Alphabetic": "Doe^Jane"})") + ']',
                           "application/dicom+json");
      response.body.insert(0, "[");
    });
    http_.Get("/studies/(.*)/series",
              [](const httplib::Request& request, httplib::Response& response) {
                const std::string study = request.matches[1];
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

 private:
  static std::string study(const std::string& uid, const std::string& name) {
    return R"({"0020000D": {"vr": "UI", "Value": [")" + uid +
           R"("]}, "00080020": {"vr": "DA", "Value": ["20261130"]}, "00100020": {"vr": "LO", "Value": ["P"]}, "00081030": {"vr": "LO", "Value": ["Head"]}, "00100010": {"vr": "PN", "Value": [)" +
           name + "]}}";
  }
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
  EXPECT_EQ(pacs.asked("PatientName"), "D*e*J&=");
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
