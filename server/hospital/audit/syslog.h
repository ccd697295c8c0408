// Sends the audit trail to a collector, as syslog over TLS (RFC 5425; IHE ITI-20).
#pragma once

#include <memory>
#include <thread>

#include "server/hospital/audit/message.h"
#include "server/hospital/audit/tls_client.h"
#include "server/store/audit_trail.h"

namespace isomesh::audit {

// The trail itself is what waits while the collector cannot be reached: it is on the disk, and in
// it is marked how far the collector has had it. Syslog acknowledges nothing, so the mark is set
// when the collector's machine has confirmed all bytes of an entry; after a crash or a connection
// that broke, some entries may come twice, with the same numbers.
class SyslogSender {
 public:
  // Begins to send. What it is made of must outlive it.
  SyslogSender(store::AuditTrail& trail, TlsServer server, AuditSource source);
  // As stop().
  ~SyslogSender() { stop(); }
  SyslogSender(const SyslogSender&) = delete;
  SyslogSender& operator=(const SyslogSender&) = delete;

  // Sends what there is, unless that takes long, and ends.
  void stop();

 private:
  void run(const std::stop_token& stop);
  // All entries after the mark. Throws Error when the collector does not take them.
  void send_new(const std::stop_token& stop);

  store::AuditTrail& trail_;
  const TlsServer server_;
  const AuditSource source_;
  std::unique_ptr<TlsClient> connection_;  // used by the thread alone; null: none
  std::stop_source cut_;                   // ends what waits for the collector
  std::jthread thread_;                    // last: runs on all of the above
};

}  // namespace isomesh::audit
