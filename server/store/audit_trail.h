// Who has had which patient's images, when, and from where to where: the interface behind which
// engines stand. Nothing that is in it is ever changed.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

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

// What --verify finds.
struct AuditCheck {
  std::uint64_t entries = 0;                 // that fit, up to the first that does not
  std::uint64_t last = 0;                    // the number of the last of those
  std::string digest = {};                   // its own
  std::optional<std::uint64_t> misfit = {};  // the first that does not
};

// Each entry has the digest of what it says and of the digest before it: SHA-256, in hex, of that
// digest (of the first entry: nothing), a line break and the entry's line. So who changes, removes
// or adds one in between has to change all digests after it, too. Those that an earlier version has
// written have none of their own; the first that has one vouches for them.
class AuditChain {
 public:
  AuditChain() = default;
  explicit AuditChain(std::string digest) : digest_(std::move(digest)) {}

  void add(std::string_view line);
  const std::string& digest() const { return digest_; }

 private:
  std::string digest_;
};

// For engines: what is kept of an entry, and how that is told.
std::string audit_record(const AuditEntry& entry);
std::string audit_line(std::uint64_t number, const std::string& at, const std::string& record);

}  // namespace isomesh::store
