// The callbacks that are not delivered yet: the interface behind which engines stand.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "server/store/expiry.h"

namespace isomesh::store {

// A callback that is to be delivered: the end of one job.
struct Delivery {
  std::string job;  // one job calls back once, so this names the delivery too
  std::string url;
  std::string body;  // the job's JSON as it ended
  int attempts = 0;  // that failed
  Time created;
};

// Kept over restarts. A job store adds the delivery of a job with a callback in the transaction
// that ends the job, so that neither is there without the other. Thread safe; all may throw Error
// kOutOfSpace or kInternal.
class Outbox {
 public:
  virtual ~Outbox() = default;

  // Those that are due at that time, the oldest first, at most `per_receiver` of each scheme, host
  // and port. Where several processes share the records, over all of them: what one has got here is
  // its own for a minute from the last time, and nobody else gets it meanwhile.
  virtual std::vector<Delivery> due(Time now, std::size_t per_receiver) const = 0;

  // When the first of those is due that are not due yet at that time; empty when there is none.
  virtual std::optional<Time> next_after(Time now) const = 0;

  // It was delivered or given up.
  virtual void remove(const std::string& job) = 0;

  // It failed once more and is due again at that time.
  virtual void postpone(const std::string& job, Time next) = 0;

  virtual std::size_t count() const = 0;
};

// Scheme, host and port.
std::string receiver_of(const std::string& url);

}  // namespace isomesh::store
