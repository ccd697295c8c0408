// Searches for series of a PACS by somebody who wants to order one.
#include <future>

#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

PacsSeries series_of(const std::string& uid, const std::string& day = "20261130") {
  return {.study = kStudy,
          .series = uid,
          .patient_id = "PAT-1",
          .patient_name = "Doe^Jane",
          .study_date = day,
          .study_description = "Head",
          .series_description = "bone",
          .modality = "CT",
          .instances = 54};
}

class SearchesTest : public OrdersTest {
 protected:
  SearchesTest() {
    settings_.pacs[1].owners = {"radiology"};
    PacsSettings sink;
    sink.name = "sink";
    settings_.pacs.push_back(sink);
    peers_["sink"] = {};
    begin();
  }

  PacsSeriesList search(const SeriesQuery& query, const std::string& pacs = "main",
                        const Orderer& who = {.name = "student", .is_administrator = false}) {
    return orders_->search(who, pacs, query);
  }

  std::vector<nlohmann::json> queries() const {
    std::vector<nlohmann::json> found;
    audit_.read(0, [&](std::string_view line) {
      auto entry = nlohmann::json::parse(line);
      if (entry.at("event") == "110112") found.push_back(std::move(entry));
    });
    return found;
  }

  const SeriesQuery patient_ = {.patient_id = "PAT-*", .date = "20261101-", .modality = "CT"};
};

TEST_F(SearchesTest, AreInTheTrail) {
  main_->find({.series = {series_of("1.2.6"), series_of("1.2.5", "20261128")}, .complete = false});
  const PacsSeriesList found = search(patient_);
  EXPECT_FALSE(found.complete);
  EXPECT_THAT(found.series, ElementsAre(series_of("1.2.6"), series_of("1.2.5", "20261128")));
  EXPECT_EQ(main_->asked().date, "20261101-");
  const auto entries = queries();
  ASSERT_THAT(entries, SizeIs(1));
  EXPECT_EQ(entries[0].at("owner"), "student");
  EXPECT_EQ(entries[0].at("pacs"), "main");
  EXPECT_EQ(entries[0].at("query"), "PatientID=PAT-*&StudyDate=20261101-&ModalitiesInStudy=CT");
  EXPECT_EQ(entries[0].at("outcome"), "success");
  EXPECT_TRUE(orders_->pacs().at(0).last_success);
}

TEST(SeriesOfASearch, AreThoseThatWereAskedFor) {
  const SeriesQuery patient = {.patient_id = "PAT-*", .date = "20261101-", .modality = "CT"};
  PacsSeries other = series_of("1.2.5");
  other.patient_id = "X";
  PacsSeries ours = series_of("1.2.6");
  ours.modality = "M3D";
  PacsSeries scout = series_of("1.2.7");
  scout.modality = "MR";
  PacsSeries silent = {.study = kStudy, .series = "1.2.8"};
  const PacsSeries october = series_of("1.2.9", "20261031");
  for (const PacsSeries& each : {other, ours, scout, october}) {
    EXPECT_FALSE(is_asked_for(each, patient)) << each.series;
  }
  EXPECT_TRUE(is_asked_for(series_of("1.2.5"), patient));
  EXPECT_TRUE(is_asked_for(silent, patient)) << "the PACS tells nothing of it";
  EXPECT_TRUE(is_asked_for(october, {.patient_name = "Roe", .date = "-20261031"}));
  EXPECT_FALSE(is_asked_for(october, {.study = "1.2"}));
}

TEST_F(SearchesTest, NeedSomethingThatSelectsStudies) {
  for (const SeriesQuery& query :
       {SeriesQuery(), SeriesQuery{.modality = "CT"}, SeriesQuery{.patient_name = "*"},
        SeriesQuery{.patient_id = "?*", .patient_name = "**"},
        SeriesQuery{.patient_name = "^ ^"}}) {
    const Error error = test::error_of([&] { search(query); });
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(error.what(), HasSubstr("a patient's ID or name, a date or a study"));
  }
  EXPECT_THAT(queries(), IsEmpty());
  EXPECT_EQ(main_->calls, 0);
}

TEST_F(SearchesTest, AreForThoseWhoMayOrderFromThePacs) {
  EXPECT_EQ(test::code_thrown_by([&] { search(patient_, "other"); }), ErrorCode::kForbidden);
  EXPECT_THAT(search(patient_, "other", {.name = "radiology"}).series, IsEmpty());
  EXPECT_THAT(search(patient_, "other", {.name = "", .is_administrator = true}).series, IsEmpty());
  EXPECT_EQ(other_->calls, 2);
  EXPECT_EQ(test::code_thrown_by([&] { search(patient_, "absent"); }), ErrorCode::kNotFound);
  const Error error = test::error_of([&] { search(patient_, "sink"); });
  EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
  EXPECT_THAT(error.fields().at(0).message, HasSubstr("without DICOMweb"));
}

TEST_F(SearchesTest, TellThatThePacsFailed) {
  main_->is_down = true;
  EXPECT_EQ(test::code_thrown_by([&] { search(patient_); }), ErrorCode::kPacsUnreachable);
  ASSERT_THAT(queries(), SizeIs(1));
  EXPECT_EQ(queries()[0].at("outcome"), "failure");
  EXPECT_EQ(orders_->pacs().at(0).reason, "unreachable");
}

TEST_F(SearchesTest, OfAPacsThatHangsHoldUpNoOthersAndEndWithTheDaemon) {
  main_->hangs = true;
  auto hanging = std::async(std::launch::async,
                            [&] { return test::code_thrown_by([&] { search(patient_); }); });
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  EXPECT_EQ(test::code_thrown_by([&] { search(patient_); }), ErrorCode::kUnavailable);
  const Orderer radiology = {.name = "radiology", .is_administrator = false};
  for (int n = 0; n < 3; ++n) search(patient_, "other", radiology);
  const std::string id = submit("other");
  EXPECT_TRUE(reaches(id, OrderState::kMeshing));
  orders_->stop();
  EXPECT_EQ(hanging.get(), ErrorCode::kUnavailable);
  EXPECT_EQ(main_->aborted, 1);
  EXPECT_EQ(test::code_thrown_by([&] { search(patient_); }), ErrorCode::kUnavailable);
  EXPECT_EQ(main_->calls, 1);
}

}  // namespace
}  // namespace isomesh::orders
