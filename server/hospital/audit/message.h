// Entries of the audit trail as others take them: an AuditMessage (DICOM PS3.15, A.5) in a message
// of syslog (RFC 5424), as IHE ITI-20 asks for. Pure functions.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::audit {

// Whose trail it is.
struct AuditSource {
  std::string station;  // AuditSourceID
  std::string host;     // HOSTNAME of syslog
  long process = 0;     // PROCID
};

// The XML of an entry, as AuditTrail::read gives it. Throws Error kInternal when it is none.
std::string audit_message(std::string_view entry, const AuditSource& source);

// The same as a message of syslog behind its length, as it goes over TLS (RFC 5425, 4.3).
std::string syslog_frame(std::string_view entry, const AuditSource& source);

}  // namespace isomesh::audit
