// What is the same of orders whatever engine keeps them. For engines only.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/store/order_store.h"

namespace isomesh::store {

// The first of the states that are final, which stand in the tables' conditions as a number.
inline constexpr int kFirstFinalOrder = 4;
static_assert(static_cast<int>(OrderState::kSucceeded) == kFirstFinalOrder);

// The last order that was made of a watched series.
struct LastOrder {
  std::uint32_t instances = 0;             // of the series for it
  std::optional<OrderState> state = {};    // empty: it is forgotten
  std::optional<std::string> record = {};  // of the order
};

// Whether it is open, or was of that many.
bool is_done(const LastOrder& last, const WatchedSeries& series);

// What becomes of the series, of which the last instance came at that time.
ReceivedFate fate_of(const LastOrder& last, const WatchedSeries& series, Time newest);

// Ends it as cancelled.
void cancel_order(OrderRecord& record);

// Has it tried from its beginning.
void begin_anew(OrderRecord& record);

}  // namespace isomesh::store
