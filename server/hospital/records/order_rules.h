// Rules for orders. Private to this folder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/hospital/records/order_store.h"

namespace isomesh::store {

// The order in a record. Empty if the record is damaged, which is logged: it must not hide or block
// other orders.
std::optional<Order> readable_order(const std::string& record, const std::string& id);

// Throws Error kInternal.
[[noreturn]] void throw_damaged_order();

// The last order made for a watched series.
struct LastOrder {
  std::uint32_t instances = 0;             // of the series at that time
  std::optional<OrderState> state = {};    // empty: the order is forgotten
  std::optional<Order> order = {};         // if it has ended; empty if its record is damaged
  std::vector<std::string> contents = {};  // if it has ended; of the instances, as far as known
};

// True if no new order is needed: the last one is still open, or had that many instances, or nobody
// knows how many there are.
bool is_done(const LastOrder& last, const WatchedSeries& series);

// Decides about a received series; `newest` is the time of its latest instance.
ReceivedFate fate_of(const LastOrder& last, const WatchedSeries& series, Time newest);

void cancel_order(OrderRecord& record);

// Resets a failed order to its beginning. Throws Error kNotReady unless it has failed.
void begin_anew(OrderRecord& record);

}  // namespace isomesh::store
