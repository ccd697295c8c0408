#include "server/store/audit_trail.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "base/sha256.h"

namespace isomesh::store {
namespace {

using Json = nlohmann::ordered_json;

struct Code {
  const char* value;
  const char* meaning;
};

Code code_of(AuditEvent event) {
  switch (event) {
    case AuditEvent::kStart:
      return {"110120", "Application Start"};
    case AuditEvent::kStop:
      return {"110121", "Application Stop"};
    case AuditEvent::kQuery:
      return {"110112", "Query"};
    case AuditEvent::kTransferred:
      return {"110104", "DICOM Instances Transferred"};
    case AuditEvent::kAuthenticationFailure:
      return {"110114", "User Authentication"};
  }
  return {"", ""};
}

}  // namespace

void AuditChain::add(std::string_view line) {
  digest_ += '\n';
  digest_ = sha256_of(digest_.append(line));
}

std::string audit_record(const AuditEntry& entry) {
  const Code code = code_of(entry.event);
  Json json = {{"event", code.value},
               {"meaning", code.meaning},
               {"outcome", entry.success ? "success" : "failure"}};
  for (const auto& [name, text] :
       {std::pair{"order", &entry.order}, std::pair{"owner", &entry.owner},
        std::pair{"pacs", &entry.pacs}, std::pair{"direction", &entry.direction},
        std::pair{"study", &entry.study}, std::pair{"patient_id", &entry.patient_id}}) {
    if (!text->empty()) json[name] = *text;
  }
  if (entry.event == AuditEvent::kTransferred) json["instances"] = entry.instances;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record) {
  // The record is appended after these two.
  const Json head = {{"id", number}, {"at", at}};
  std::string text = head.dump();
  text.back() = ',';
  return text + record.substr(1);
}

}  // namespace isomesh::store
