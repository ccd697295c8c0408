// Interface of the store of volume records.
#pragma once

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/store/expiry.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// Order of a list, by the time of storing.
enum class ListOrder { kOldestFirst, kNewestFirst };

// What becomes of the jobs on an erased volume.
enum class Made { kKept, kErased };

// Records by owner and id. The same samples may belong to several records, of one owner or several,
// which share one blob. A record is added after its blob and erased before it, so it never names a
// missing blob. Thread safe; all methods may throw Error kOutOfSpace or kInternal.
class VolumeStore {
 public:
  virtual ~VolumeStore() = default;

  // Adds a record, or returns the owner's existing one. Second: true if it is new.
  virtual std::pair<Volume, bool> add(const std::string& owner, const Volume& volume) = 0;

  // Throws Error kNotFound, or kGone if the record has expired.
  virtual Volume get(const Viewer& viewer, const std::string& id) const = 0;

  // The same for what does not depend on this one volume: empty if there is no such record, and if
  // it is damaged.
  std::optional<Volume> find(const Viewer& viewer, const std::string& id) const;

  // Sets or removes the name of the owner's record, and returns the record. Throws as get does.
  virtual Volume rename(const std::string& owner, const std::string& id,
                        const std::optional<std::string>& name) = 0;

  // The key of the blob of a record's samples, also if the record is damaged. Empty if there is no
  // such record.
  virtual std::optional<std::string> samples_of(const Viewer& viewer,
                                                const std::string& id) const = 0;
  bool contains(const Viewer& viewer, const std::string& id) const {
    return samples_of(viewer, id).has_value();
  }

  // True if a record of the owner names the blob of these samples.
  virtual bool has_samples(const std::string& owner, const std::string& samples) const = 0;

  // A secret of the database, in hex, for the part of ids that depends on persons. It never
  // changes.
  virtual std::string key() const = 0;

  // At most `limit` volumes, without their labels, after the one with the cursor `after`.
  virtual std::vector<Volume> list(const Viewer& viewer, const std::string& after = {},
                                   std::size_t limit = std::numeric_limits<std::size_t>::max(),
                                   ListOrder order = ListOrder::kOldestFirst) const = 0;

  // Erases every record of that id visible to the viewer and, if `made` says so, all ended jobs
  // of their owners on the volume, as JobStore::erase does. Throws Error kNotFound; kGone;
  // kNotReady while a queued or running job of one of their owners needs the volume.
  virtual void erase(const Viewer& viewer, const std::string& id, Made made = Made::kKept,
                     const BlobsGoing& going = {}) = 0;

  // True if any record, of a volume, mesh, order or received instance, names the blob.
  virtual bool names(const std::string& blob) const = 0;

  // Volumes that match the filter and that no queued or running job of their owner needs, oldest
  // first, at most `limit`.
  virtual std::vector<Expirable> unused(const ExpiryFilter& filter, std::size_t limit) const = 0;

  // As JobStore::expire. Skips volumes used since unused() listed them.
  virtual Expired expire(std::span<const Expirable> volumes, std::uint64_t enough) = 0;

  // Total size of the blobs that volumes name; each counts once.
  virtual std::uint64_t named_bytes() const = 0;
  virtual OwnedBytes owned_bytes() const = 0;
};

// The cursor with which list() continues after this volume.
std::string cursor_of(const Volume& volume);

}  // namespace isomesh::store
