#include "server/store/audit_trail.h"

#include <algorithm>
#include <utility>

#include "base/sha256.h"
#include "proto/json_tree.h"

namespace isomesh::store {
namespace {

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
  JsonTree json;
  const auto put = [&](const char* name, std::string_view text) {
    json_values::assign(json_values::member(json.root(), name), text);
  };
  put("event", code.value);
  put("meaning", code.meaning);
  put("outcome", entry.success ? "success" : "failure");
  for (const auto& [name, text] :
       {std::pair{"order", &entry.order}, std::pair{"owner", &entry.owner},
        std::pair{"pacs", &entry.pacs}, std::pair{"direction", &entry.direction},
        std::pair{"study", &entry.study}, std::pair{"patient_id", &entry.patient_id},
        std::pair{"peer", &entry.peer}, std::pair{"called", &entry.called},
        std::pair{"calling", &entry.calling}}) {
    if (!text->empty()) put(name, *text);
  }
  if (entry.event == AuditEvent::kTransferred) {
    json_values::assign(json_values::member(json.root(), "instances"), entry.instances);
  }
  if (entry.unlisted > 0) {
    json_values::assign(json_values::member(json.root(), "unlisted"), entry.unlisted);
  }
  return dump(json.root());
}

std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record) {
  // The record is appended after these two.
  JsonTree head;
  json_values::assign(json_values::member(head.root(), "id"), number);
  json_values::assign(json_values::member(head.root(), "at"), std::string_view(at));
  std::string text = dump(head.root());
  // Damage may have emptied it. The line is not JSON then, as with other damage.
  text.back() = ',';
  return text.append(record, std::min<std::size_t>(1, record.size()));
}

}  // namespace isomesh::store
