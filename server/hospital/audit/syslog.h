// Sends the audit trail to a collector, as syslog over TLS (RFC 5425; IHE ITI-20).
#pragma once

#include <memory>
#include <thread>

#include "server/hospital/audit/message.h"
#include "server/hospital/audit/tls_client.h"
#include "server/store/audit/trail.h"

namespace isomesh::audit {

// While the collector is unreachable, entries wait in the trail itself, which is on disk and
// records how far the collector has received it. Syslog has no acknowledgements, so that mark is
// set when the collector's TCP has confirmed all bytes of an entry. After a crash or a lost
// connection some entries may be sent twice, with the same numbers.
class SyslogSender {
 public:
  // Starts sending. The trail must outlive this object.
  SyslogSender(store::AuditTrail& trail, TlsServer server, AuditSource source);
  // As stop().
  ~SyslogSender() { stop(); }
  SyslogSender(const SyslogSender&) = delete;
  SyslogSender& operator=(const SyslogSender&) = delete;

  // Sends the remaining entries, for a short time at most, and ends.
  void stop();

 private:
  void run(const std::stop_token& stop);
  // Sends all entries after the mark. Throws Error if the collector does not accept them.
  void send_new(const std::stop_token& stop);

  store::AuditTrail& trail_;
  const TlsServer server_;
  const AuditSource source_;
  std::unique_ptr<TlsClient> connection_;  // used by the thread only; null: not connected
  std::stop_source cut_;                   // aborts waiting for the collector
  std::jthread thread_;                    // last: uses all other members
};

}  // namespace isomesh::audit
