#include <expat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/base64.h"
#include "server/hospital/audit/message.h"
#include "tests/support/errors.h"

namespace isomesh::audit {
namespace {

using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

const AuditSource kSource = {.station = "isomesh-1", .host = "mesh.example.org", .process = 42};

bool is_xml(const std::string& text) {
  XML_Parser parser = XML_ParserCreate(nullptr);
  const bool is_good = XML_Parse(parser, text.data(), static_cast<int>(text.size()), 1) != 0;
  XML_ParserFree(parser);
  return is_good;
}

constexpr const char* kTransfer =
    R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110104","meaning":"x","outcome":"success",)"
    R"("order":"o","owner":"radio \"<&>","pacs":"main","direction":"out","study":"1.2.3",)"
    R"("patient_id":"PAT & 1","instances":12})";

TEST(AuditMessage, SaysWhoHadWhatOfWhom) {
  const std::string xml = audit_message(kTransfer, kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("<EventIdentification EventActionCode=\"C\" "
                             "EventDateTime=\"2026-11-20T10:00:00.123Z\" "
                             "EventOutcomeIndicator=\"0\"><EventID csd-code=\"110104\" "
                             "codeSystemName=\"DCM\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"isomesh-1\" UserIsRequestor=\"false\"><RoleIDCode "
                             "csd-code=\"110153\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"main\" UserIsRequestor=\"false\"><RoleIDCode "
                             "csd-code=\"110152\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"radio &quot;&lt;&amp;&gt;\" UserIsRequestor=\"true\"/>"));
  EXPECT_THAT(xml, HasSubstr("ParticipantObjectID=\"1.2.3\" ParticipantObjectTypeCode=\"2\" "
                             "ParticipantObjectTypeCodeRole=\"3\"><ParticipantObjectIDTypeCode "
                             "csd-code=\"110180\""));
  EXPECT_THAT(xml, HasSubstr("NumberOfInstances=\"12\""));
  EXPECT_THAT(xml,
              HasSubstr("ParticipantObjectID=\"PAT &amp; 1\" ParticipantObjectTypeCode=\"1\""));
  // The schema's order.
  EXPECT_LT(xml.find("<ActiveParticipant"), xml.find("<AuditSourceIdentification"));
  EXPECT_LT(xml.find("<AuditSourceIdentification"), xml.find("<ParticipantObjectIdentification"));
}

TEST(AuditMessage, OfASearchHasItsQuery) {
  const std::string query = "PatientName=Doe*";
  const std::string xml = audit_message(
      R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110112","outcome":"success",)"
      R"("owner":"radio","pacs":"main","query":")" +
          query + "\"}",
      kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("<ParticipantObjectQuery>" + to_base64(query) + '<'));
  EXPECT_THAT(xml, HasSubstr("UserID=\"radio\" UserIsRequestor=\"true\""));
}

TEST(AuditMessage, ComingInIsTheOtherWayRound) {
  std::string in = kTransfer;
  in.replace(in.find("\"out\""), 5, "\"in\"");
  EXPECT_THAT(
      audit_message(in, kSource),
      HasSubstr("UserID=\"main\" UserIsRequestor=\"false\"><RoleIDCode csd-code=\"110153\""));
}

TEST(AuditMessage, ByCStoreTheSenderIsItsTitle) {
  const std::string xml = audit_message(
      R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110104","outcome":"success",)"
      R"("pacs":"dimse:BONE","direction":"in","study":"1.2.3","peer":"10.0.0.7","called":"BONE",)"
      R"("calling":"CT1","instances":12})",
      kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("UserID=\"CT1\" UserIsRequestor=\"true\"><RoleIDCode "
                             "csd-code=\"110153\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"isomesh-1\" UserIsRequestor=\"false\"><RoleIDCode "
                             "csd-code=\"110152\""));
}

TEST(AuditMessage, OfAReadingNamesTheReaderAndTheAddress) {
  const std::string xml = audit_message(
      R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110104","outcome":"success",)"
      R"("direction":"out","study":"1.2.3","patient_id":"PAT","peer":"10.0.0.7","caller":"ann",)"
      R"("what":"slice","volume":"abc","requests":12})",
      kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("UserID=\"ann\" UserIsRequestor=\"true\" "
                             "NetworkAccessPointID=\"10.0.0.7\" "
                             "NetworkAccessPointTypeCode=\"2\"><RoleIDCode csd-code=\"110152\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"isomesh-1\" UserIsRequestor=\"false\"><RoleIDCode "
                             "csd-code=\"110153\""));
  EXPECT_THAT(xml, HasSubstr("NumberOfInstances=\"12\""));
  EXPECT_THAT(xml, HasSubstr("ParticipantObjectID=\"PAT\""));
}

TEST(AuditMessage, OfARefusedLoginNamesTheAddress) {
  const std::string xml = audit_message(
      R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110114","outcome":"failure",)"
      R"("peer":"10.0.0.7","what":"login"})",
      kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("<EventTypeCode csd-code=\"110122\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"10.0.0.7\" UserIsRequestor=\"true\""));
}

TEST(AuditMessage, OfWhatARoleDoesNotAllowNamesTheLogin) {
  const std::string xml = audit_message(
      R"({"id":7,"at":"2026-11-20T10:00:00.123Z","event":"110113","outcome":"failure",)"
      R"("peer":"10.0.0.7","caller":"oidc:248289761001","what":"permission"})",
      kSource);
  EXPECT_TRUE(is_xml(xml)) << xml;
  EXPECT_THAT(xml, HasSubstr("<EventTypeCode csd-code=\"110132\""));
  EXPECT_THAT(xml, HasSubstr("UserID=\"oidc:248289761001\" UserIsRequestor=\"true\" "
                             "NetworkAccessPointID=\"10.0.0.7\""));
}

TEST(AuditMessage, EveryEventHasOne) {
  for (const auto& [code, id, type] :
       {std::tuple{"110120", "110100", "110120"}, std::tuple{"110121", "110100", "110121"},
        std::tuple{"110112", "110112", ""}, std::tuple{"110113", "110113", "110132"},
        std::tuple{"110114", "110114", "110126"}}) {
    const std::string xml =
        audit_message(std::string(R"({"id":1,"at":"2026-11-20T10:00:00.123Z","event":")") + code +
                          R"(","outcome":"failure","pacs":"main"})",
                      kSource);
    EXPECT_TRUE(is_xml(xml)) << xml;
    EXPECT_THAT(xml, HasSubstr(std::string("<EventID csd-code=\"") + id));
    if (*type != '\0') {
      EXPECT_THAT(xml, HasSubstr(std::string("<EventTypeCode csd-code=\"") + type));
    } else {
      EXPECT_THAT(xml, Not(HasSubstr("EventTypeCode")));
    }
    EXPECT_THAT(xml, HasSubstr("EventOutcomeIndicator=\"4\""));
  }
}

TEST(AuditMessage, WhatIsNoEntryIsADefect) {
  for (const char* text : {"", "{}", "[1]", R"({"event":"1","outcome":"success","at":""})"}) {
    const Error error = test::error_of([&] { audit_message(text, kSource); }, text);
    EXPECT_EQ(error.code(), ErrorCode::kInternal);
  }
}

TEST(SyslogFrame, HasItsLengthAndItsHead) {
  const std::string frame = syslog_frame(kTransfer, kSource);
  const std::size_t blank = frame.find(' ');
  EXPECT_EQ(std::stoul(frame.substr(0, blank)), frame.size() - blank - 1);
  EXPECT_THAT(frame.substr(blank + 1),
              StartsWith("<85>1 2026-11-20T10:00:00.123Z mesh.example.org isomeshd 42 "
                         "DICOM+RFC3881 - \xEF\xBB\xBF<?xml version=\"1.0\" encoding=\"UTF-8\"?>"
                         "<AuditMessage>"));
}

}  // namespace
}  // namespace isomesh::audit
