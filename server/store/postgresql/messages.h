#pragma once

#include <functional>
#include <set>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "base/wakeup.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Changes reported by a node, or possibly missed.
struct News {
  bool has_work = false;
  bool has_events = false;
  bool has_progress = false;        // runs of other nodes may have advanced; not part of messages
  std::set<std::string> cancelled;  // jobs that should stop
};

// Messages between nodes by NOTIFY, which spare them polling the database. They are hints only:
// `listener` is also called every second, and after a lost connection, as if there were work and
// events. Uses one connection and one thread. Messages sent at the same time are combined, because
// NOTIFY serialises commits. Thread safe.
class Messages {
 public:
  using Listener = std::function<bool(const News&)>;

  // The thread calls `listener`, which must not throw. While it returns true, it is also called
  // every 300 ms to read progress.
  Messages(const Database& database, Listener listener);
  ~Messages();
  Messages(const Messages&) = delete;
  Messages& operator=(const Messages&) = delete;

  // Sends to all nodes, including this one.
  void tell(const News& news);

 private:
  void run(const std::stop_token& stop);
  void listen(const std::stop_token& stop);
  News send(Connection& connection);

  const Database& database_;
  const Listener listener_;
  Wakeup wakeup_;
  Mutex mutex_;
  News to_tell_ ISOMESH_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace isomesh::store::postgresql
