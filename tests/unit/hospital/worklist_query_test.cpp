// Searches of the own worklist.
#include <string>

#include <gtest/gtest.h>

#include "server/hospital/worklist/query.h"
#include "tests/support/errors.h"
#include "tests/unit/hospital/worklist.h"

namespace isomesh::worklist {
namespace {

bool finds(const std::string& name, const std::string& value) {
  return matches(parse_query({{name, value}}), data_of(test::new_record()));
}

TEST(WorklistQuery, MatchesByKindOfValue) {
  for (const auto& [name, value] : {
           std::pair<std::string, std::string>{"ProcedureStepState", "SCHEDULED"},
           {"00741000", "SCHEDULED"},
           {"00741000", ""},
           {"PatientID", "PAT-1"},
           {"PatientID", "PAT*"},
           {"PatientID", "*"},
           {"AdmissionID", "*"},
           {"AdmissionID", ""},
           {"PatientName", "doe^*"},
           {"StudyInstanceUID", "1.6,1.7"},
           {"0020000d", "1.7\\1.8"},
           {"ScheduledWorkitemCodeSequence.CodeValue", "MESH"},
           {"00404018.00080102", "99?"},
           {"InputInformationSequence.SeriesInstanceUID", "1.7.1"},
           {"ScheduledProcedureStepStartDateTime", "20260102"},
           {"ScheduledProcedureStepStartDateTime", "20260101-20260103"},
           {"ScheduledProcedureStepStartDateTime", "2026-2027"},
           {"ScheduledProcedureStepStartDateTime", "20260102000000-0500-20260103000000-0500"},
           {"ScheduledProcedureStepStartDateTime", "-20260102"},
           {"ScheduledProcedureStepStartDateTime", "20260102030405-"},
       }) {
    EXPECT_TRUE(finds(name, value)) << name << '=' << value;
  }
  for (const auto& [name, value] : {
           std::pair<std::string, std::string>{"ProcedureStepState", "COMPLETED"},
           {"PatientID", "PAT"},
           {"PatientID", "pat-1"},
           {"PatientID", "pat*"},
           {"AdmissionID", "A*"},
           {"PatientName", "Roe*"},
           {"StudyInstanceUID", "1.77"},
           {"ScheduledWorkitemCodeSequence.CodeValue", "READ"},
           {"ScheduledWorkitemCodeSequence", "MESH"},
           {"PatientID.CodeValue", "PAT-1"},
           {"ScheduledProcedureStepStartDateTime", "20260103-"},
           {"ScheduledProcedureStepStartDateTime", "-2025"},
           {"ScheduledProcedureStepStartDateTime", "20250101-20251231"},
       }) {
    EXPECT_FALSE(finds(name, value)) << name << '=' << value;
  }
}

TEST(WorklistQuery, ComparesMomentsOfAllZones) {
  DataSet data = data_of(test::new_record());
  const auto finds = [&](const std::string& moment, const std::string& wanted) {
    data["00404005"]["Value"] = {moment};
    return matches(parse_query({{"ScheduledProcedureStepStartDateTime", wanted}}), data);
  };
  EXPECT_TRUE(finds("20260102230000-0500", "20260103033000+0000-20260103043000+0000"));
  EXPECT_TRUE(finds("20260102230000-0500", "20260103040000+0000"));
  EXPECT_TRUE(finds("20260102230000-0500", "20260103053000+0130"));
  EXPECT_TRUE(finds("20260102230000-0500", "2026010304+0000-"));
  EXPECT_TRUE(finds("20260102230000-0500", "20260103033000 0000-20260103043000 0000"));
  EXPECT_TRUE(finds("20260103003015.5+0100", "-20260102233015.5+0000"));
  EXPECT_TRUE(finds("20260102230000-0500", "20260101000000+0000-99991231235959+0000"));
  EXPECT_TRUE(finds("99991231235959-0500", "20260101000000+0000-"));
  EXPECT_FALSE(finds("20260102230000-0500", "20260102230000+0000"));
  EXPECT_FALSE(finds("20260102230000-0500", "-20260103035900+0000"));
}

// "0800-1200" is a range, although "-1200" could be the zone of a DT.
TEST(WorklistQuery, HasRangesOfTimes) {
  DataSet data = data_of(test::new_record());
  const auto finds = [&](const std::string& time, const std::string& wanted) {
    data["00100032"] = attribute("TM", time);
    return matches(parse_query({{"00100032", wanted}}), data);
  };
  for (const char* wanted : {"0800-1200", "10-1030", "1000-", "-1100", "101500", "0930-1015"}) {
    EXPECT_TRUE(finds("101500", wanted)) << wanted;
  }
  for (const char* wanted : {"0800-1000", "1100-1400", "1030-", "-1000", "101501", "0930-1014"}) {
    EXPECT_FALSE(finds("101500", wanted)) << wanted;
  }
}

TEST(WorklistQuery, KnowsWhatItDoesNotSearchFor) {
  for (const auto& [name, value] : {
           std::pair<std::string, std::string>{"PatientsName", "x"},
           {"0010001", "x"},
           {"ScheduledWorkitemCodeSequence.", "x"},
           {"fuzzymatching", "yes"},
           {"limit", "-1"},
           {"offset", "x"},
           {"TransactionUID", "1.99"},
           {"00081195", "1*"},
           {"00404021.00081195", "1*"},
       }) {
    const Error error = test::error_of(
        [&, &from = name, &to = value] {
          parse_query({{from, to}});
        },
        name);
    ASSERT_EQ(error.code(), ErrorCode::kInvalidParameter) << name;
    EXPECT_EQ(error.fields().front().field, name);
  }
}

TEST(WorklistQuery, HasItsPlaceInTheList) {
  const Query query = parse_query({{"limit", "5000"},
                                   {"offset", "7"},
                                   {"includefield", "all"},
                                   {"fuzzymatching", "false"},
                                   {"ProcedureStepState", "IN PROGRESS"}});
  EXPECT_EQ(query.limit, kMostResults);
  EXPECT_EQ(query.offset, 7U);
  EXPECT_EQ(query.state(), store::WorkitemState::kInProgress);
  EXPECT_FALSE(query.wants_fuzzy);
  for (const char* yes : {"true", "TRUE"}) {
    EXPECT_TRUE(parse_query({{"fuzzymatching", yes}}).wants_fuzzy) << yes;
  }
  EXPECT_EQ(parse_query({{"ProcedureStepState", "*"}}).state(), std::nullopt);
}

}  // namespace
}  // namespace isomesh::worklist
