// Sends events of jobs to clients (Server-Sent Events).
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/net/fair_places.h"
#include "server/net/sender.h"
#include "server/store/job_store.h"

namespace isomesh::http {

// Distributes events to the listeners of their jobs. Thread safe.
class Broadcaster {
 public:
  // One listener's events. New progress of a job replaces its unread progress, so the mailbox stays
  // short while it is read.
  class Mailbox {
   public:
    void put(const store::Event& event) ISOMESH_EXCLUDES(mutex_);
    std::optional<store::Event> take() ISOMESH_EXCLUDES(mutex_);
    bool has_lost_some() ISOMESH_EXCLUDES(mutex_);

   private:
    Mutex mutex_;
    std::deque<store::Event> events_ ISOMESH_GUARDED_BY(mutex_);
    bool has_lost_some_ ISOMESH_GUARDED_BY(mutex_) = false;
  };

  // Returns a mailbox that gets the job's events from now on, until its last owner releases it.
  std::shared_ptr<Mailbox> listen_to(const std::string& job);
  // The same for all jobs visible to the viewer.
  std::shared_ptr<Mailbox> listen_to_all(const store::Viewer& viewer);

  // Puts the event into the mailboxes of its job. Returns false if there are none.
  bool publish(const store::Event& event);

 private:
  struct Listener {
    std::weak_ptr<Mailbox> mailbox;
    store::Viewer viewer;  // for listeners to all jobs
  };

  std::shared_ptr<Mailbox> add(const std::string& job, const store::Viewer& viewer);

  Mutex mutex_;
  // By job; listeners to all jobs are at "".
  std::multimap<std::string, Listener> listeners_ ISOMESH_GUARDED_BY(mutex_);
};

struct EventStream {
  std::shared_ptr<Broadcaster::Mailbox> mailbox;
  std::vector<store::Event> past;
  std::uint64_t last = 0;               // the last event that the listener has seen
  std::function<std::string()> result;  // the ended job, as JSON
  net::FairPlaces::Place place;         // one of the limited streams
  // The stream ends once this returns false.
  std::function<bool()> may_listen = [] { return true; };
};

// Ends with the job's last event. Sends at least a comment every 15 seconds, to detect a lost
// client.
std::unique_ptr<net::Source> event_source(EventStream stream);

// All future events of a mailbox, each with its job's id, but without the finished job at the end.
// Ends if events were lost, so that the client queries its jobs and reconnects, and once
// `may_listen` returns false. Sends comments as above.
std::unique_ptr<net::Source> event_source(
    std::shared_ptr<Broadcaster::Mailbox> mailbox, net::FairPlaces::Place place,
    std::function<bool()> may_listen = [] { return true; });

}  // namespace isomesh::http
