#pragma once

#include <functional>
#include <set>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// What a node has told the others, or what may have been missed.
struct News {
  bool has_work = false;
  bool has_events = false;
  bool has_progress = false;        // runs of other nodes may be further; nobody tells that
  std::set<std::string> cancelled;  // jobs that were asked to stop
};

// What nodes tell each other by NOTIFY, so that nobody has to ask the database all the time. It is
// no more than a hint: `hear` is also called every second as if there were work and events, and
// after a lost connection. One connection and one thread; what many tell at a time goes as one
// message, because a NOTIFY makes commits wait for each other. Thread safe.
class Messages {
 public:
  using Hear = std::function<bool(const News&)>;

  // `hear` is called by the thread and must not throw. While it returns true it is also called
  // every 300 ms because of progress.
  Messages(const Database& database, Hear hear);
  ~Messages();
  Messages(const Messages&) = delete;
  Messages& operator=(const Messages&) = delete;

  // Tells all nodes, this one too.
  void tell(const News& news);

 private:
  void run(const std::stop_token& stop);
  void listen(const std::stop_token& stop);
  News send(Connection& connection);
  void wake() const;

  const Database& database_;
  const Hear hear_;
  int wake_ = -1;
  Mutex mutex_;
  News to_tell_ ISOMESH_GUARDED_BY(mutex_);
  std::jthread thread_;
};

}  // namespace isomesh::store::postgresql
