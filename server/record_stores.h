// The stores of records, for any database engine.
#pragma once

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "server/options.h"
#include "server/store/audit_trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/order_store.h"
#include "server/store/outbox.h"
#include "server/store/received_store.h"
#include "server/store/sql/schema.h"
#include "server/store/volume_store.h"

namespace isomesh {

// The tables of the components that this daemon was built with.
std::vector<store::Schema> components();

// Thread safe.
class RecordStores {
 public:
  virtual ~RecordStores() = default;

  virtual store::JobStore& jobs() = 0;
  virtual store::VolumeStore& volumes() = 0;
  virtual store::Outbox& outbox() = 0;
  virtual store::OrderStore& orders() = 0;
  virtual store::AuditTrail& audit() = 0;
  virtual store::ReceivedStore& received() = 0;
  // The current time, as far as the clock is plausible (store/believed_clock.h).
  virtual store::Time now() = 0;

  // Makes this process responsible for orders, or keeps it so. Returns an empty text if it is until
  // the next call, which must come within a second or so; otherwise why it is not, for example
  // because another process that shares the records is. Does not throw.
  virtual std::string keep_orders() = 0;
};

// Opens the stores of --store; `tolerance` is how far a clock may be ahead. Throws Error
// kUnavailable if they do not respond, or do not belong to the blobs. Both must outlive it.
std::unique_ptr<RecordStores> open_record_stores(const Options& options,
                                                 const store::DataFolder& folder,
                                                 store::BlobStore& blobs,
                                                 std::chrono::milliseconds tolerance);

// Opens only the audit trail, also beside daemons, and reads it; see AuditTrail::read. Changes
// nothing.
void read_audit_trail(const Options& options, std::uint64_t after,
                      const std::function<void(std::string_view line)>& line);

// The same, but verifies the digests of all entries.
store::AuditCheck verify_audit_trail(const Options& options);

}  // namespace isomesh
