// The stores of records, of whatever engine.
#pragma once

#include <chrono>
#include <memory>

#include "server/options.h"
#include "server/store/audit_trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/order_store.h"
#include "server/store/outbox.h"
#include "server/store/received_store.h"
#include "server/store/volume_store.h"

namespace isomesh {

// Thread safe.
class Records {
 public:
  virtual ~Records() = default;

  virtual store::JobStore& jobs() = 0;
  virtual store::VolumeStore& volumes() = 0;
  virtual store::Outbox& outbox() = 0;
  virtual store::OrderStore& orders() = 0;
  virtual store::AuditTrail& audit() = 0;
  virtual store::ReceivedStore& received() = 0;
  // The time, as far as it can be believed.
  virtual store::Time now() = 0;

  // Takes it upon this process to carry out orders. Throws Error kUnavailable when another one that
  // shares the records does.
  virtual void take_orders() = 0;
};

// Opens those that --store names; how far a clock may be ahead is `tolerance`. Throws Error
// kUnavailable when they do not answer, or do not belong to the blobs. Both must outlive it.
std::unique_ptr<Records> open_records(const Options& options, const store::DataFolder& folder,
                                      store::BlobStore& blobs, std::chrono::milliseconds tolerance);

// Opens the audit trail alone, beside a daemon that uses it, and reads it; see AuditTrail::read.
void read_audit_trail(const Options& options, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

// The same, and checks the digests of all entries.
store::AuditCheck verify_audit_trail(const Options& options);

}  // namespace isomesh
