// The records of the volumes that are there: the interface behind which engines stand.
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

// Of what is listed, by the time when it was stored.
enum class ListOrder { kOldestFirst, kNewestFirst };

// Records by owner and id: the same samples may belong to several owners, each with a record of its
// own, while the blob that the id names is shared. A record is added after its blob and erased
// before it, so it never names one that is missing. Thread safe; all may throw Error kOutOfSpace or
// kInternal.
class VolumeStore {
 public:
  virtual ~VolumeStore() = default;

  // Adds a record, or returns the one that the owner has already. Second: whether it is new.
  virtual std::pair<Volume, bool> add(const std::string& owner, const Volume& volume) = 0;

  // Throws Error kNotFound, or kGone when it has expired.
  virtual Volume get(const Viewer& viewer, const std::string& id) const = 0;

  // Gives the owner's record another name, or none, and returns it. Throws as get does.
  virtual Volume rename(const std::string& owner, const std::string& id,
                        const std::optional<std::string>& name) = 0;

  virtual bool contains(const Viewer& viewer, const std::string& id) const = 0;

  // In that order, without their labels; at most `limit` that come after the one that `after` is
  // the cursor of.
  virtual std::vector<Volume> list(const Viewer& viewer, const std::string& after = {},
                                   std::size_t limit = std::numeric_limits<std::size_t>::max(),
                                   ListOrder order = ListOrder::kOldestFirst) const = 0;

  // Every record of that id that the viewer sees. Throws Error kNotFound, kGone, and kNotReady
  // while a queued or running job of one of their owners needs the volume.
  virtual void erase(const Viewer& viewer, const std::string& id) = 0;

  // Whether any record, of a volume or of a mesh, names the blob.
  virtual bool names(const std::string& blob) const = 0;

  // Volumes, as the filter says, that no queued or running job of their owner needs, the oldest
  // first, at most `limit`.
  virtual std::vector<Expirable> unused(const ExpiryFilter& filter, std::size_t limit) const = 0;

  // As JobStore::expire. A volume that was used since unused() named it is passed over.
  virtual Expired expire(std::span<const Expirable> volumes, std::uint64_t enough) = 0;

  // Of the blobs that volumes name, each counted once.
  virtual std::uint64_t named_bytes() const = 0;
  virtual OwnedBytes owned_bytes() const = 0;
};

// What list() continues after.
std::string cursor_of(const Volume& volume);

}  // namespace isomesh::store
