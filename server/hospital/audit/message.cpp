#include "server/hospital/audit/message.h"

#include <limits>

#include "base/base64.h"
#include "base/error.h"
#include "base/xml.h"
#include "proto/json_tree.h"

namespace isomesh::audit {
namespace {

struct Code {
  std::string_view value;
  std::string_view system;
  std::string_view meaning;
};

constexpr Code kApplication = {"110150", "DCM", "Application"};
constexpr Code kSource = {"110153", "DCM", "Source Role ID"};
constexpr Code kDestination = {"110152", "DCM", "Destination Role ID"};
constexpr Code kStudyUid = {"110180", "DCM", "Study Instance UID"};
constexpr Code kSopClassUid = {"110181", "DCM", "SOP Class UID"};
constexpr Code kPatientNumber = {"2", "RFC-3881", "Patient Number"};

// SOP class of a query for the instances of a series (PS3.4, C.6.2).
constexpr std::string_view kStudyRootFind = "1.2.840.10008.5.1.4.1.2.2.1";

std::string text_of(const Json& entry, const char* name) {
  const Json* const found = json_values::find(entry, name);
  return found == nullptr ? "" : json_values::text(*found);
}

std::string attribute(std::string_view name, std::string_view value) {
  return ' ' + std::string(name) + "=\"" + xml_escaped(value) + '"';
}

std::string coded(std::string_view element, const Code& code) {
  return '<' + std::string(element) + attribute("csd-code", code.value) +
         attribute("codeSystemName", code.system) + attribute("originalText", code.meaning) + "/>";
}

// `address` is that of the user's machine; empty if unknown.
std::string participant(std::string_view user, bool is_requestor, const Code* role,
                        std::string_view address = {}) {
  std::string head = "<ActiveParticipant" + attribute("UserID", user) +
                     attribute("UserIsRequestor", is_requestor ? "true" : "false");
  if (!address.empty()) {
    // Type 2: an IP address.
    head +=
        attribute("NetworkAccessPointID", address) + attribute("NetworkAccessPointTypeCode", "2");
  }
  if (role == nullptr) return head + "/>";
  return head + '>' + coded("RoleIDCode", *role) + "</ActiveParticipant>";
}

// Types and roles of objects: PS3.15, table A.5-1.
std::string object(std::string_view id, std::string_view type, std::string_view role,
                   const Code& kind, const std::string& content) {
  return "<ParticipantObjectIdentification" + attribute("ParticipantObjectID", id) +
         attribute("ParticipantObjectTypeCode", type) +
         attribute("ParticipantObjectTypeCodeRole", role) + '>' +
         coded("ParticipantObjectIDTypeCode", kind) + content +
         "</ParticipantObjectIdentification>";
}

std::string study_object(const Json& entry) {
  const std::string study = text_of(entry, "study");
  if (study.empty()) return "";
  const Json* instances = json_values::find(entry, "instances");
  if (instances == nullptr) instances = json_values::find(entry, "requests");
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  const std::string count =
      std::to_string(instances == nullptr ? 0 : json_values::whole(*instances, kMost));
  return object(study, "2", "3", kStudyUid,
                "<ParticipantObjectDescription><SOPClass" + attribute("NumberOfInstances", count) +
                    "/></ParticipantObjectDescription>");
}

std::string patient_object(const Json& entry) {
  const std::string patient = text_of(entry, "patient_id");
  return patient.empty() ? "" : object(patient, "1", "1", kPatientNumber, "");
}

struct Event {
  std::string_view action;  // create, execute
  Code id;
  Code type = {};  // empty: none
};

Event event_of(const std::string& code, bool is_login) {
  const Code application = {"110100", "DCM", "Application Activity"};
  if (code == "110120") return {"E", application, {"110120", "DCM", "Application Start"}};
  if (code == "110121") return {"E", application, {"110121", "DCM", "Application Stop"}};
  if (code == "110112") return {"E", {"110112", "DCM", "Query"}};
  if (code == "110104") return {"C", {"110104", "DCM", "DICOM Instances Transferred"}};
  if (code == "110114") {
    const Code login = {"110122", "DCM", "Login"};
    const Code node = {"110126", "DCM", "Node Authentication"};
    return {"E", {"110114", "DCM", "User Authentication"}, is_login ? login : node};
  }
  if (code == "110113") {
    const Code restricted = {"110132", "DCM", "Use of Restricted Function"};
    return {"E", {"110113", "DCM", "Security Alert"}, restricted};
  }
  throw Error(ErrorCode::kInternal, "has an unknown event");
}

struct Content {
  std::string participants;
  std::string objects = {};
};

// Somebody read data of a patient over HTTP, could not log in, or tried what is not allowed.
Content content_of_request(const Json& entry, const std::string& what, const AuditSource& source) {
  const std::string address = text_of(entry, "peer");
  const std::string caller = text_of(entry, "caller");
  const std::string& user = caller.empty() ? address : caller;
  const bool is_refused = what == "login" || what == "permission";
  return {participant(user.empty() ? "unix" : user, true, is_refused ? nullptr : &kDestination,
                      address) +
              participant(source.station, false, is_refused ? nullptr : &kSource),
          study_object(entry) + patient_object(entry)};
}

Content content_of(const Json& entry, const std::string& code, const AuditSource& source) {
  const std::string what = text_of(entry, "what");
  if (!what.empty()) return content_of_request(entry, what, source);
  const std::string peer = text_of(entry, "pacs");
  const std::string owner = text_of(entry, "owner");
  const std::string asked = owner.empty() ? "" : participant(owner, true, nullptr);
  if (code == "110112") {
    const std::string search = text_of(entry, "query");
    const std::string query = search.empty() ? "study " + text_of(entry, "study") : search;
    return {participant(source.station, owner.empty(), &kSource) +
                participant(peer, false, &kDestination) + asked,
            object(kStudyRootFind, "2", "3", kSopClassUid,
                   "<ParticipantObjectQuery>" + to_base64(query) + "</ParticipantObjectQuery>")};
  }
  if (code == "110104") {
    const bool is_in = text_of(entry, "direction") == "in";
    // By C-STORE, a peer sends without being asked.
    const std::string sender = text_of(entry, "calling");
    if (!sender.empty()) {
      return {
          participant(sender, true, &kSource) + participant(source.station, false, &kDestination),
          study_object(entry)};
    }
    return {participant(is_in ? peer : source.station, !is_in && owner.empty(), &kSource) +
                participant(is_in ? source.station : peer, is_in && owner.empty(), &kDestination) +
                asked,
            study_object(entry) + patient_object(entry)};
  }
  if (code == "110114") {
    return {participant(peer, true, nullptr) + participant(source.station, false, nullptr)};
  }
  return {participant(source.station, false, &kApplication)};
}

}  // namespace

std::string audit_message(std::string_view text, const AuditSource& source) {
  try {
    const JsonTree tree(text);
    const Json& entry = tree.root();
    const std::string code = json_values::text(json_values::existing(entry, "event"));
    const Event event = event_of(code, text_of(entry, "what") == "login");
    const bool is_success = text_of(entry, "outcome") == "success";
    // A failure is serious only if the operation cannot continue; these operations are retried.
    const Content content = content_of(entry, code, source);
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?><AuditMessage><EventIdentification" +
           attribute("EventActionCode", event.action) +
           attribute("EventDateTime", text_of(entry, "at")) +
           attribute("EventOutcomeIndicator", is_success ? "0" : "4") + '>' +
           coded("EventID", event.id) +
           (event.type.value.empty() ? "" : coded("EventTypeCode", event.type)) +
           "</EventIdentification>" + content.participants + "<AuditSourceIdentification" +
           attribute("AuditSourceID", source.station) +
           "><AuditSourceTypeCode csd-code=\"4\"/></AuditSourceIdentification>" + content.objects +
           "</AuditMessage>";
  } catch (const Error& error) {
    throw error.with_detail(std::string("an entry of the audit trail ") + error.what());
  }
}

std::string syslog_frame(std::string_view entry, const AuditSource& source) {
  // Facility 10 (security), severity 5 (notice). The byte order mark announces UTF-8.
  const std::string time = text_of(JsonTree(entry).root(), "at");
  const std::string message = "<85>1 " + time + ' ' + source.host + " isomeshd " +
                              std::to_string(source.process) + " DICOM+RFC3881 - \xEF\xBB\xBF" +
                              audit_message(entry, source);
  return std::to_string(message.size()) + ' ' + message;
}

}  // namespace isomesh::audit
