// The store of orders. One process carries out an order step by step, and saves each
// step before the next, so that after a crash another process can continue.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/hospital/protocol/orders.h"
#include "server/store/blob_store.h"
#include "server/store/expiry.h"
#include "server/store/job_store.h"
#include "server/store/sql/sql.h"

namespace isomesh::store {

// The longest time for which an order may wait for its next step.
inline constexpr std::chrono::days kLongestWait{7};

struct OrderRecord {
  std::string owner;
  Order order;
  OrderWork work;
  // The record in the database is damaged: these members have only what its columns tell.
  bool is_damaged = false;
};

struct OrderSpec {
  OrderRecord record;           // with its id
  std::string idempotency_key;  // unique within the owner's; empty: none
  std::string request_digest;
};

struct OrderSubmission {
  enum class Kind {
    kNew,
    kExisting,  // the order submitted before with the same key and request
    kConflict,  // the key was used for another request
    kBusy,      // nothing was stored: too many orders are open
  };

  Kind kind = Kind::kNew;
  Order order;  // for kNew and kExisting
};

// A series found by the watch of a rule.
struct WatchedSeries {
  std::string rule;
  std::string study;
  std::string series;
  std::optional<std::uint32_t> instances = {};  // empty: the PACS does not tell
  // For a received series: the contents of the instances that are held, as in OrderWork.
  std::vector<std::string> contents = {};
};

enum class ReceivedFate {
  kNew,   // an order was stored
  kOpen,  // an order is still open, or too many orders are open
  kDone,  // an order covered all instances, with their contents
};

// Lets an order that performs a workitem tell its worklist of that end before it ends. Returns
// false if it performs none, or tells an end already.
bool end_at_worklist(OrderRecord& record, OrderState end);

struct OrderFilter {
  std::optional<OrderState> state = {};
  std::optional<std::string> rule = {};
};

struct CancelledOrder {
  Order order;
  std::vector<std::string> blobs;  // that it named until its end
};

struct OrderCounts {
  std::map<std::pair<OrderState, std::string>, std::uint64_t> by_state_and_rule;
  std::optional<Time> oldest_open = {};
};

// Thread safe. Each method is one transaction. All may throw Error kOutOfSpace (nothing has
// changed) or kInternal.
class OrderStore {
 public:
  // True if this process carries out the orders, until the transaction ends.
  using IsOurs = std::function<bool(SqlConnection&)>;

  // The database must outlive this object. Only a process that carries out the orders can save
  // steps.
  explicit OrderStore(
      SqlDatabase& database, IsOurs is_ours = [](SqlConnection&) { return true; })
      : database_(database), is_ours_(std::move(is_ours)) {}
  virtual ~OrderStore() = default;

  // Stores an order that is due at once. At most `most_open` orders may be open.
  OrderSubmission submit(const OrderSpec& spec, std::size_t most_open);

  // Stores an order for a series found by a watch, unless one is open or was made for the same
  // number of instances, or for any if that is unknown. Returns true if it did.
  bool submit_watched(const OrderSpec& spec, const WatchedSeries& series, std::size_t most_open);

  // Stores an order for a received series whose latest instance came at `last`, unless one is open
  // or one for the same number of instances has succeeded. After an order that ended otherwise,
  // instances that arrive later give a new one. So do instances with other contents than those of
  // the order, for example of a corrected patient.
  ReceivedFate submit_received(const OrderSpec& spec, const WatchedSeries& series, Time last,
                               std::size_t most_open);

  // Throws Error kNotFound.
  Order get(const Viewer& viewer, const std::string& id) const;

  // Newest first; at most `limit` orders older than the order `after` (empty: from the newest).
  std::vector<Order> list(const Viewer& viewer, const OrderFilter& filter, const std::string& after,
                          std::size_t limit) const;

  // Open orders that are due, longest overdue first. An order that is due later than any waits is
  // due now: the clock was set back.
  virtual std::vector<OrderRecord> due(Time now, std::size_t limit) const;
  // Returns the order if it is due.
  std::optional<OrderRecord> if_due(const std::string& id, Time now) const;
  // The earliest due time after `now` of an open order.
  virtual std::optional<Time> next_after(Time now) const;

  // Saves a step and the time of the next one, which is at most kLongestWait away. From now on the
  // order names exactly the blobs of its work; in a final state it names none. Entering a final
  // state also adds its callback, in the same transaction. Returns false, without changes, if the
  // order is already in a final state because it was cancelled or is to be cancelled, or if another
  // process carries out the orders now.
  virtual bool save(const OrderRecord& record, Time next);

  // The blobs that the order names.
  std::vector<std::string> blobs(const std::string& id) const;

  // Makes an open order due now.
  void hurry(const std::string& id);

  // Cancels an open order; an ended one stays as it is. One that performs a workitem stays open
  // until it has told the worklist, unless it is cancelled again. Throws Error kNotFound.
  virtual CancelledOrder cancel(const Viewer& viewer, const std::string& id);

  // Restarts a failed order from its beginning. Throws Error kNotFound; kNotReady unless it has
  // failed.
  Order retry(const Viewer& viewer, const std::string& id);

  OrderCounts counts() const;

  // Removes orders that ended before that time, and watched series of which the last order was made
  // before `watched`. Returns the number of orders.
  std::size_t forget(Time before, Time watched);

 private:
  std::vector<Order> list_after(const Viewer& viewer, const OrderFilter& filter,
                                const std::string& after, std::size_t limit) const;
  // The same from a table with damaged pages.
  std::vector<Order> undamaged_after(const Viewer& viewer, const OrderFilter& filter,
                                     const std::string& after, std::size_t limit) const;

  SqlDatabase& database_;
  const IsOurs is_ours_;
};

}  // namespace isomesh::store
