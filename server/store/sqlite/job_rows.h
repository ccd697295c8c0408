// Shared by the two halves of SqliteJobStore: a transaction that announces its changes. Private to
// this folder.
#pragma once

#include <string>

#include "server/store/job_rules.h"
#include "server/store/sqlite/job_store.h"

namespace isomesh::store {

// One transaction and its events, which become visible when it ends.
class SqliteJobStore::Change {
 public:
  Change(SqliteJobStore& store, Durability durability = Durability::kFull)
      : log_(store.log_), transaction_(store.database_.writer(), durability) {}
  // The transaction's lock is still held, so its events are the last ones.
  ~Change() {
    if (announced_ > 0 && transaction_.is_open()) log_.withdraw(announced_);
  }
  Change(const Change&) = delete;
  Change& operator=(const Change&) = delete;

  Connection* operator->() const { return &transaction_.connection(); }
  Connection& connection() const { return transaction_.connection(); }

  // Stores an event with the row's present state.
  void announce(const Row& row, EventKind kind);

  void commit() {
    if (announced_ > 0) {
      transaction_.at_end([&log = log_](bool is_committed) { log.end_transaction(is_committed); });
    }
    transaction_.commit();
  }

 private:
  EventLog& log_;
  std::size_t announced_ = 0;
  Transaction transaction_;  // last: its lock is held until the events are withdrawn
};

// The longest possible delay of a job. A longer one means that the clock was set back.
inline constexpr std::int64_t kLongestWaitUs = std::int64_t{3600} * 1'000'000;

}  // namespace isomesh::store
