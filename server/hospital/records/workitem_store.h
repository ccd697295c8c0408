// The store of the workitems of the own worklist (PS3.4, CC).
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "server/store/expiry.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// The table has the numbers, so they stay.
enum class WorkitemState { kScheduled = 0, kInProgress = 1, kCompleted = 2, kCanceled = 3 };

struct WorkitemRecord {
  std::string uid;
  WorkitemState state = WorkitemState::kScheduled;
  std::string transaction = {};  // secret, never in the data; empty: not claimed
  std::string data;  // an object of the DICOM JSON Model, with a digest (record_digest.h)

  bool operator==(const WorkitemRecord&) const = default;
};

struct WorkitemLimits {
  std::size_t most = 0;
  std::uint64_t most_bytes = 0;  // of the data of all
};

// Thread safe. Each method is one transaction. All may throw Error kOutOfSpace (nothing has
// changed) or kInternal.
class WorkitemStore {
 public:
  // The database must outlive this object.
  explicit WorkitemStore(SqlDatabase& database) : database_(database) {}

  enum class Added {
    kNew,
    kExists,  // there is one with this UID
    kFull,    // nothing was stored: the limits are reached
  };
  Added add(const WorkitemRecord& record, const WorkitemLimits& limits);

  std::optional<WorkitemRecord> find(const std::string& uid) const;

  // Stores what `change` makes of the record, unless that throws. `change` may run more than once.
  // Returns false if there is no such workitem.
  bool change(const std::string& uid, const std::function<void(WorkitemRecord&)>& change);

  // Calls `use` for the workitems in that state, or for all, oldest first, while it returns true.
  void read(std::optional<WorkitemState> state,
            const std::function<bool(const WorkitemRecord&)>& use) const;

  // Removes workitems that did not change since that time, in any state. Returns their number.
  std::size_t forget(Time before);

 private:
  SqlDatabase& database_;
};

}  // namespace isomesh::store
