// The stores of records, for any database engine.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/options.h"
#include "server/store/audit/trail.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/job_store.h"
#include "server/store/outbox.h"
#include "server/store/sql/sql.h"
#include "server/store/volume_store.h"

namespace isomesh {

// Thread safe.
class RecordStores {
 public:
  virtual ~RecordStores() = default;

  virtual store::JobStore& jobs() = 0;
  virtual store::VolumeStore& volumes() = 0;
  virtual store::Outbox& outbox() = 0;
  virtual store::AuditTrail& audit() = 0;
  // All of them, for components with own tables.
  virtual store::SqlDatabase& database() = 0;
  // The current time, as far as the clock is plausible (store/believed_clock.h).
  virtual store::Time now() = 0;

  // Makes this process responsible for the work of wings, such as orders, or keeps it so. Returns
  // an empty text if it is until the next call, which must come within a second or so; otherwise
  // why it is not, for example because another process that shares the records is. Does not throw.
  virtual std::string keep_task() = 0;
  // True if it is, until the transaction ends.
  virtual bool has_task(store::SqlConnection& connection) = 0;
};

// Opens the stores of --store; `tolerance` is how far a clock may be ahead. Throws Error
// kUnavailable if they do not respond, or do not belong to the blobs. Both must outlive it.
std::unique_ptr<RecordStores> open_record_stores(const Options& options,
                                                 const store::DataFolder& folder,
                                                 store::BlobStore& blobs,
                                                 std::chrono::milliseconds tolerance);

// Opens only the audit trail, also beside daemons, and changes nothing. Calls `act` with a
// connection, for read_trail() and verify_trail().
void with_trail(const Options& options, const std::function<void(store::SqlConnection&)>& act);

}  // namespace isomesh
