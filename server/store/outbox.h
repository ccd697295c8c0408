#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "proto/types.h"
#include "server/store/database.h"

namespace isomesh::store {

// A callback that is to be delivered: the end of one job.
struct Delivery {
  std::string job;  // one job calls back once, so this names the delivery too
  std::string url;
  std::string body;  // the job's JSON as it ended
  int attempts = 0;  // that failed
  std::chrono::system_clock::time_point created;
};

// The callbacks that are not delivered yet, kept over restarts. Thread safe; `database` must
// outlive it. All may throw Error kOutOfSpace or kInternal.
class Outbox {
 public:
  using Time = std::chrono::system_clock::time_point;

  explicit Outbox(Database& database) : database_(database) {}

  // Has the end of a job delivered, if it has a callback. Part of the transaction that ends it, so
  // that neither is there without the other.
  static void add(Connection& connection, const Job& job);

  // Those that are due at that time, the oldest first, at most `per_receiver` of each scheme, host
  // and port.
  std::vector<Delivery> due(Time now, std::size_t per_receiver) const;

  // When the first of those is due that are not due yet at that time; empty when there is none.
  std::optional<Time> next_after(Time now) const;

  // It was delivered or given up.
  void remove(const std::string& job);

  // It failed once more and is due again at that time.
  void postpone(const std::string& job, Time next);

  std::size_t count() const;

 private:
  Database& database_;
};

}  // namespace isomesh::store
