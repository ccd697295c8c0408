// The rules of the own worklist, by PS3.4, CC and PS3.18, 11.
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/flips.h"
#include "tests/unit/hospital/worklist.h"

namespace isomesh::worklist {
namespace {

using store::WorkitemRecord;
using store::WorkitemState;
using test::kNoon;
using testing::HasSubstr;

DataSet to_state(const std::string& state, const std::string& transaction = "") {
  DataSet data = {{"00741000", attribute("CS", state)}};
  if (!transaction.empty()) data["00081195"] = attribute("UI", transaction);
  return data;
}

WorkitemRecord claimed() {
  WorkitemRecord record = test::new_record();
  change_state(record, to_state("IN PROGRESS", "1.99"), kNoon);
  return record;
}

// A performer tells this before the workitem can be completed.
DataSet performed() {
  return {{"00741216", attribute("SQ", {{"00404028", attribute("SQ", test::code("isomesh"))},
                                        {"00404019", attribute("SQ", test::code("MESH"))},
                                        {"00404050", attribute("DT", "20260102030405")},
                                        {"00404051", attribute("DT", "20260102030505")},
                                        {"00404033", {{"vr", "SQ"}}}})}};
}

// The status, and the warning if there is one.
std::string refusal_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const Refusal& refusal) {
    return std::to_string(describe(refusal.code()).status) + ' ' + refusal.warning();
  } catch (const Error& error) {
    return std::to_string(describe(error.code()).status) +
           (error.fields().empty() ? "" : ' ' + error.fields().front().field);
  }
  return "accepted";
}

TEST(WorklistRules, ARecordWithAWrongByteIsNoOther) {
  test::expect_wrong_bytes_found(claimed().data, [](const std::string& data) {
    WorkitemRecord record = claimed();
    record.data = data;
    return data_of(record);
  });
}

TEST(WorklistRules, ANewWorkitemHasItsUidAndNoSecret) {
  const WorkitemRecord record = test::new_record();
  EXPECT_EQ(record.uid, "1.2.3");
  EXPECT_EQ(record.state, WorkitemState::kScheduled);
  const DataSet data = data_of(record);
  EXPECT_EQ(text_of(data, "00080018"), "1.2.3");
  EXPECT_EQ(text_of(data, "00080016"), "1.2.840.10008.5.1.4.34.6.1");
  EXPECT_EQ(text_of(data, "00404010").size(), 19U);
  EXPECT_EQ(text_of(data, "00741202"), "isomesh");
}

TEST(WorklistRules, ANewWorkitemIsComplete) {
  const auto without = [](const char* tag) {
    DataSet data = test::scheduled();
    data.erase(tag);
    return refusal_of([&] { new_workitem("1.2.3", data, kNoon); });
  };
  for (const char* tag : {"00741000", "00741200", "00741204", "00404005", "00404041"}) {
    EXPECT_EQ(without(tag), std::string("400 ") + tag);
  }
  EXPECT_EQ(without("0020000D"), "accepted");
  const auto with = [](const char* tag, const nlohmann::json& element, const std::string& uid) {
    DataSet data = test::scheduled();
    data[tag] = element;
    return refusal_of([&] { new_workitem(uid, data, kNoon); });
  };
  EXPECT_EQ(with("00741000", attribute("CS", "IN PROGRESS"), "1.2"), "400 00741000");
  EXPECT_EQ(with("00741200", attribute("CS", "URGENT"), "1.2"), "400 00741200");
  EXPECT_EQ(with("00081195", attribute("UI", "1.99"), "1.2"), "400 00081195");
  EXPECT_EQ(with("00081195", {{"vr", "UI"}}, "1.2"), "accepted");
  EXPECT_EQ(with("00741216", performed()["00741216"], "1.2"), "400 00741216");
  EXPECT_EQ(with("00080018", attribute("UI", "1.2"), ""), "accepted");
  EXPECT_EQ(with("00080018", attribute("UI", "1.2"), "1.3"), "400 00080018");
  EXPECT_EQ(with("00080018", {{"vr", "UI"}}, ""), "400 00080018");
}

TEST(WorklistRules, OneIsClaimedByOne) {
  WorkitemRecord record = test::new_record();
  const auto state = [&](const DataSet& request) {
    return refusal_of([&] { change_state(record, request, kNoon); });
  };
  const std::string inconsistent =
      "409 The submitted request is inconsistent with the state of the UPS Instance.";
  EXPECT_EQ(state(to_state("IN PROGRESS")), "400 The Transaction UID is missing.");
  EXPECT_EQ(state(to_state("IN PROGRESS", "x")), "400 00081195");
  EXPECT_EQ(state(to_state("SCHEDULED", "1.99")), "400 00741000");
  EXPECT_EQ(state(to_state("COMPLETED", "1.99")), inconsistent);
  EXPECT_EQ(state(to_state("IN PROGRESS", "1.99")), "accepted");
  EXPECT_EQ(state(to_state("IN PROGRESS", "1.99")), inconsistent);
  EXPECT_EQ(state(to_state("IN PROGRESS", "1.98")), inconsistent);
  EXPECT_EQ(record.transaction, "1.99");
  EXPECT_THAT(record.data, Not(HasSubstr("1.99")));
  EXPECT_EQ(text_of(data_of(record), "00741000"), "IN PROGRESS");
}

TEST(WorklistRules, OnlyThePerformerEndsOne) {
  WorkitemRecord record = claimed();
  const auto state = [&](const DataSet& request) {
    return refusal_of([&] { change_state(record, request, kNoon); });
  };
  const std::string inconsistent =
      "409 The submitted request is inconsistent with the state of the UPS Instance.";
  EXPECT_EQ(state(to_state("COMPLETED")), "400 The Transaction UID is missing.");
  EXPECT_EQ(state(to_state("COMPLETED", "1.98")), "400 The Transaction UID is incorrect.");
  EXPECT_EQ(state(to_state("COMPLETED", "1.99")), inconsistent);  // nothing was performed
  update(record, performed(), "1.99", kNoon);
  EXPECT_EQ(state(to_state("COMPLETED", "1.99")), "accepted");
  EXPECT_EQ(change_state(record, to_state("COMPLETED", "1.99"), kNoon),
            "The UPS is already in the requested state of COMPLETED.");
  EXPECT_EQ(state(to_state("CANCELED", "1.99")), inconsistent);
}

TEST(WorklistRules, ACompletedOneSaysWhatWasDone) {
  for (const char* tag : {"00404028", "00404019", "00404050", "00404051", "00404033"}) {
    WorkitemRecord record = claimed();
    DataSet changes = performed();
    changes["00741216"]["Value"][0].erase(tag);
    update(record, changes, "1.99", kNoon);
    const Error error =
        test::error_of([&] { change_state(record, to_state("COMPLETED", "1.99"), kNoon); }, tag);
    EXPECT_THAT(error.what(), HasSubstr(tag));
    EXPECT_EQ(record.state, WorkitemState::kInProgress);
  }
}

TEST(WorklistRules, APerformerThatGivesUpNeedsNoReason) {
  WorkitemRecord record = claimed();
  change_state(record, to_state("CANCELED", "1.99"), kNoon);
  const DataSet data = data_of(record);
  EXPECT_EQ(text_of(data, "00741000"), "CANCELED");
  const DataSet progress = values_of(data, "00741002").at(0);
  EXPECT_FALSE(text_of(progress, "00404052").empty());
  EXPECT_EQ(text_of(values_of(progress, "0074100E").at(0), "00080100"), "110513");
}

TEST(WorklistRules, WhoMayUpdateDependsOnTheState) {
  const DataSet changes = {{"00741204", attribute("LO", "New")}};
  const auto updating = [&](WorkitemRecord& record, const DataSet& what, const std::string& as) {
    return refusal_of([&] { update(record, what, as, kNoon); });
  };
  const std::string inconsistent =
      "400 The submitted request is inconsistent with the current state of the Workitem.";
  WorkitemRecord fresh = test::new_record();
  EXPECT_EQ(updating(fresh, changes, "1.99"),
            "400 The target URI did not reference a claimed Workitem.");
  EXPECT_EQ(updating(fresh, changes, ""), "accepted");
  EXPECT_EQ(text_of(data_of(fresh), "00741204"), "New");
  WorkitemRecord held = claimed();
  EXPECT_EQ(updating(held, changes, ""), inconsistent);
  EXPECT_EQ(updating(held, changes, "1.98"), inconsistent);
  DataSet with_secret = changes;
  with_secret["00081195"] = attribute("UI", "1.99");
  EXPECT_EQ(updating(held, with_secret, "1.98"), inconsistent);
  EXPECT_EQ(updating(held, with_secret, ""), "accepted");
  EXPECT_THAT(held.data, Not(HasSubstr("1.99")));
  change_state(held, to_state("CANCELED", "1.99"), kNoon);
  EXPECT_EQ(updating(held, changes, "1.99"), inconsistent);
}

TEST(WorklistRules, UpdatesLeavePatientAndStateAlone) {
  WorkitemRecord record = test::new_record();
  const auto updating = [&](const char* tag, const nlohmann::json& element) {
    return refusal_of([&] { update(record, {{tag, element}}, "", kNoon); });
  };
  EXPECT_EQ(updating("00741000", attribute("CS", "COMPLETED")), "400 00741000");
  EXPECT_EQ(updating("00741000", attribute("CS", "SCHEDULED")), "accepted");
  EXPECT_EQ(updating("00100020", attribute("LO", "PAT-2")), "400 00100020");
  EXPECT_EQ(updating("0020000D", attribute("UI", "1.8")), "400 0020000D");
  EXPECT_EQ(updating("00404041", attribute("CS", "SOON")), "400 00404041");
  EXPECT_EQ(updating("00741238", attribute("LT", std::string(kMostBodyBytes, 'x'))), "413");
  EXPECT_EQ(text_of(data_of(record), "00100020"), "PAT-1");
}

TEST(WorklistRules, OthersCancelWhatNobodyPerforms) {
  const DataSet reason = {{"00741238", attribute("LT", "Wrong patient")},
                          {"0074100C", attribute("LO", "Dr. No")}};
  WorkitemRecord fresh = test::new_record();
  EXPECT_EQ(cancel(fresh, reason, kNoon), "");
  EXPECT_EQ(fresh.state, WorkitemState::kCanceled);
  const DataSet progress = values_of(data_of(fresh), "00741002").at(0);
  EXPECT_EQ(text_of(progress, "00741238"), "Wrong patient");
  EXPECT_EQ(text_of(values_of(progress, "00741008").at(0), "0074100C"), "Dr. No");
  EXPECT_EQ(cancel(fresh, reason, kNoon), "The UPS is already in the requested state of CANCELED.");
  WorkitemRecord held = claimed();
  EXPECT_EQ(refusal_of([&] { cancel(held, reason, kNoon); }),
            "409 The performer cannot be contacted.");
  update(held, performed(), "1.99", kNoon);
  change_state(held, to_state("COMPLETED", "1.99"), kNoon);
  EXPECT_EQ(refusal_of([&] { cancel(held, reason, kNoon); }), "409 The UPS is already COMPLETED.");
}

TEST(WorklistRules, WhatIsNoDataSetIsNamed) {
  std::string deep = R"({"00404021":{"vr":"SQ","Value":[)";
  std::string nested;
  for (int n = 0; n < 100; ++n) nested += deep;
  for (const auto& [text, field] : {
           std::pair<std::string, std::string>{"", ""},
           {"[]", ""},
           {"[{},{}]", ""},
           {"7", ""},
           {nested, ""},
           {R"({"state":{"vr":"CS"}})", "state"},
           {R"({"00020010":{"vr":"UI"}})", "00020010"},
           {R"({"00741000":"SCHEDULED"})", "00741000"},
           {R"({"00741000":{"vr":"XX"}})", "00741000"},
           {R"({"00741000":{"vr":"CS","Value":"SCHEDULED"}})", "00741000"},
           {R"({"00741000":{"vr":"CS","Value":[{}]}})", "00741000"},
           {R"({"00404021":{"vr":"SQ","Value":["x"]}})", "00404021"},
           {R"({"00404021":{"vr":"SQ","Value":[{"1":{"vr":"CS"}}]}})", "1"},
           {R"({"00100010":{"vr":"PN","Value":["Doe"]}})", "00100010"},
           {R"({"7FE00010":{"vr":"OW","BulkDataURI":"http://x"}})", "7FE00010"},
       }) {
    const Error error = test::error_of([&, &body = text] { parse_data_set(body); }, text);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter) << text;
    EXPECT_EQ(error.fields().empty() ? "" : error.fields().front().field, field) << text;
  }
  EXPECT_EQ(parse_data_set(R"([{"0074100e":{"vr":"SQ","Value":[]}}])").dump(),
            R"({"0074100E":{"vr":"SQ"}})");
}

TEST(WorklistRules, ValuesOfAnotherKindAreNamed) {
  const auto data = [](const std::string& vr, const std::string& value) {
    return parse_data_set(R"({"00404021":{"vr":"SQ","Value":[{"00741000":{"vr":")" + vr +
                          R"(","Value":[)" + value + "]}}]}}");
  };
  for (const auto& [vr, value] : {std::pair<std::string, std::string>{"CS", "7"},
                                  {"DT", "20260102"},
                                  {"US", R"("7")"},
                                  {"FD", R"("0.5")"},
                                  {"OB", R"("AAAA")"},
                                  {"UN", "7"}}) {
    const Error error =
        test::error_of([&, &kind = vr, &what = value] { check_types(data(kind, what)); }, vr);
    ASSERT_EQ(error.code(), ErrorCode::kInvalidParameter) << vr;
    EXPECT_EQ(error.fields().front().field, "00741000") << vr;
  }
  for (const auto& [vr, value] : {std::pair<std::string, std::string>{"CS", R"("READY",null)"},
                                  {"US", "7"},
                                  {"FD", "0.5,1"},
                                  {"DS", R"("0.5",0.5)"},
                                  {"IS", R"(7,"7")"},
                                  {"UV", R"("18446744073709551615")"},
                                  {"PN", R"({"Alphabetic":"Doe^Jane"})"}}) {
    EXPECT_NO_THROW(check_types(data(vr, value))) << vr;
  }
}

}  // namespace
}  // namespace isomesh::worklist
