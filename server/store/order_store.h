// Orders and what became of them: the interface behind which engines stand. What an order does is
// done step by step by one process; each step is saved before the next begins, so that a process
// that comes after a crash goes on where the last one was.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "proto/orders.h"
#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/job_store.h"

namespace isomesh::store {

// An order as its engine sees it.
struct OrderRecord {
  std::string owner;
  Order order;
  OrderWork work;
};

struct OrderSpec {
  OrderRecord record;           // with an id
  std::string idempotency_key;  // within the owner's; empty: none
  std::string request_digest;
};

struct OrderSubmission {
  enum class Kind {
    kNew,
    kExisting,  // the order that the same key and request made before
    kConflict,  // the key came with another request before
    kBusy,      // nothing was stored: too many orders are open
  };

  Kind kind = Kind::kNew;
  Order order;  // of kNew and kExisting
};

// A series as a rule's watch has seen it.
struct WatchedSeries {
  std::string rule;
  std::string study;
  std::string series;
  std::uint32_t instances = 0;
};

// What became of a series that was received.
enum class ReceivedFate {
  kNew,   // it has an order now
  kOpen,  // it has one, which has not ended, or too many orders are open
  kDone,  // it had one, of all that has come
};

// Which orders to list.
struct OrderFilter {
  std::optional<OrderState> state = {};
  std::optional<std::string> rule = {};
};

struct OrderCounts {
  std::map<std::pair<OrderState, std::string>, std::uint64_t> by_state_and_rule;
  std::optional<Time> oldest_open = {};
};

// Thread safe. Every verb is one transaction. All may throw Error kOutOfSpace (then nothing has
// changed) or kInternal.
class OrderStore {
 public:
  virtual ~OrderStore() = default;

  // Stores an order that is due at once. `most_open` orders may be open.
  virtual OrderSubmission submit(const OrderSpec& spec, std::size_t most_open) = 0;

  // Stores an order for a series that a watch has found, unless one for it is open, or one has been
  // made of that many instances. Returns whether it did.
  virtual bool submit_watched(const OrderSpec& spec, const WatchedSeries& series,
                              std::size_t most_open) = 0;

  // Stores an order for a series that was received, the last of its instances at that time, unless
  // one for it is open, or one that has succeeded was of that many instances. After one that ended
  // otherwise there is another when something came later.
  virtual ReceivedFate submit_received(const OrderSpec& spec, const WatchedSeries& series,
                                       Time last, std::size_t most_open) = 0;

  // Throws Error kNotFound.
  virtual Order get(const Viewer& viewer, const std::string& id) const = 0;

  // Newest first; at most `limit` that are older than the order `after` (empty: from the newest).
  virtual std::vector<Order> list(const Viewer& viewer, const OrderFilter& filter,
                                  const std::string& after, std::size_t limit) const = 0;

  // Open orders whose time has come, the longest due first.
  virtual std::vector<OrderRecord> due(Time now, std::size_t limit) const = 0;
  // The order, if it is one of those now.
  virtual std::optional<OrderRecord> if_due(const std::string& id, Time now) const = 0;
  // The earliest time after `now` at which an open order is due.
  virtual std::optional<Time> next_after(Time now) const = 0;

  // Saves a step, and when the next is due. The blobs that its work names are named by it from now
  // on, and no others; in a final state none are. A callback is told of a final state in the same
  // transaction. False, and nothing has changed, when the order is in a final state already: it was
  // cancelled meanwhile.
  virtual bool save(const OrderRecord& record, Time next) = 0;

  // Has an open order looked at now.
  virtual void hurry(const std::string& id) = 0;

  // An open order ends; one that has ended stays as it is. Throws Error kNotFound.
  virtual Order cancel(const Viewer& viewer, const std::string& id) = 0;

  // A failed order is tried anew from its beginning. Throws Error kNotFound, and kNotReady for one
  // that has not failed.
  virtual Order retry(const Viewer& viewer, const std::string& id) = 0;

  virtual OrderCounts counts() const = 0;

  // Removes orders that ended before that time. Returns how many.
  virtual std::size_t forget(Time before) = 0;
};

}  // namespace isomesh::store
