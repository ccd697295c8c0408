// Who has had which patient's images, when, and from where to where: the interface behind which
// engines stand. Nothing that is in it is ever changed.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace isomesh::store {

// The events of PS3.15, A.5, that concern orders, by their codes in DICOM's coding scheme.
enum class AuditEvent {
  kStart,                  // 110120 Application Start
  kStop,                   // 110121 Application Stop
  kQuery,                  // 110112 Query
  kTransferred,            // 110104 DICOM Instances Transferred
  kAuthenticationFailure,  // 110114 User Authentication, which failed
};

struct AuditEntry {
  AuditEvent event = AuditEvent::kStart;
  bool success = true;
  std::string order = {};      // empty: of none
  std::string owner = {};      // for whom
  std::string pacs = {};       // the peer's name
  std::string direction = {};  // "in" or "out" of transfers
  std::string study = {};
  std::uint64_t instances = 0;
  std::string patient_id = {};
};

// Thread safe. All may throw Error kOutOfSpace or kInternal.
class AuditTrail {
 public:
  virtual ~AuditTrail() = default;

  virtual void add(const AuditEntry& entry) = 0;

  // Calls `line` with each entry after the one with the number `after`, oldest first, as one object
  // of JSON without a line break.
  virtual void read(std::uint64_t after,
                    const std::function<void(std::string_view line)>& line) const = 0;

  // The number of the last entry that a collector has had; 0 for none.
  virtual std::uint64_t sent() const = 0;
  virtual void note_sent(std::uint64_t number) = 0;
};

// For engines: what is kept of an entry, and how that is told.
std::string audit_record(const AuditEntry& entry);
std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record);

}  // namespace isomesh::store
