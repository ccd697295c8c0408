// Formats entries of the audit trail for collectors: an AuditMessage (DICOM PS3.15, A.5) in a
// syslog message (RFC 5424), as IHE ITI-20 requires. Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::audit {

struct AuditSource {
  std::string station;  // AuditSourceID
  std::string host;     // HOSTNAME of syslog
  long process = 0;     // PROCID
};

// The XML of an entry as AuditTrail::read returns it. Throws Error kInternal if the entry is
// invalid.
std::string audit_message(std::string_view entry, const AuditSource& source);

// As a syslog message preceded by its length, the framing for TLS (RFC 5425, 4.3).
std::string syslog_frame(std::string_view entry, const AuditSource& source);

}  // namespace isomesh::audit
