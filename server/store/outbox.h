// Interface of the store of undelivered callbacks.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/store/expiry.h"

namespace isomesh::store {

// A callback to deliver: the end of one job or order.
struct Delivery {
  std::string job;  // or order; it has one callback, so its id identifies the delivery
  std::string url;
  std::string body;  // its JSON at its end
  int attempts = 0;  // failed ones
  Time created;
  std::int64_t created_us = 0;  // by the clock of the records: a retried order ends again later
};

// The longest time for which a delivery may be postponed.
inline constexpr std::chrono::hours kLongestPostponed{24};

// Survives restarts. The job store adds a delivery in the transaction that ends the job, so that
// both happen or neither does. Thread safe; all methods may throw Error kOutOfSpace or kInternal.
class Outbox {
 public:
  virtual ~Outbox() = default;

  // Deliveries due at `now`, or later than any is postponed, which means that the clock was set
  // back; oldest first, at most `per_receiver` for each scheme, host and port.
  // If several processes share the records, the limit holds across them, and each returned delivery
  // is reserved for this process for a minute.
  virtual std::vector<Delivery> due(Time now, std::size_t per_receiver) const = 0;

  // The earliest due time after `now`; empty if there is none.
  virtual std::optional<Time> next_after(Time now) const = 0;

  // Removes a delivery that succeeded or was given up. Like postpone(), does nothing if the order
  // has ended again since due() returned it: that end stays due.
  virtual void remove(const Delivery& delivery) = 0;

  // Counts a failed attempt; the delivery is due again at `next`.
  virtual void postpone(const Delivery& delivery, Time next) = 0;

  virtual std::size_t count() const = 0;
};

// Scheme, host and port.
inline std::string receiver_of(const std::string& url) {
  const std::size_t host = url.find("://");
  return url.substr(0, host == std::string::npos ? host : url.find_first_of("/?#", host + 3));
}

}  // namespace isomesh::store
