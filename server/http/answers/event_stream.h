// Events of jobs, sent to clients that follow them (Server-Sent Events).
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

// Hands events on to the listeners of their jobs. Thread safe.
class Broadcaster {
 public:
  // One listener's events. A job's progress that nobody has read is replaced by its newer one, so
  // it is never long while somebody reads.
  class Mailbox {
   public:
    // More than these are not kept for whoever does not read.
    static constexpr std::size_t kMostUnread = 4096;

    void put(const store::Event& event) ISOMESH_EXCLUDES(mutex_);
    std::optional<store::Event> take() ISOMESH_EXCLUDES(mutex_);
    // Whether events were lost because too many were unread.
    bool has_lost_some() ISOMESH_EXCLUDES(mutex_);

   private:
    Mutex mutex_;
    std::deque<store::Event> events_ ISOMESH_GUARDED_BY(mutex_);
    bool has_lost_some_ ISOMESH_GUARDED_BY(mutex_) = false;
  };

  // The mailbox gets the job's events from now on, until its last owner is gone.
  std::shared_ptr<Mailbox> listen_to(const std::string& job);
  // The same for all jobs that the viewer sees.
  std::shared_ptr<Mailbox> listen_to_all(const store::Viewer& viewer);

  // Puts the event into the mailboxes of its job; false when there are none.
  bool publish(const store::Event& event);

 private:
  struct Listener {
    std::weak_ptr<Mailbox> mailbox;
    store::Viewer viewer;  // of those to all jobs
  };

  std::shared_ptr<Mailbox> add(const std::string& job, const store::Viewer& viewer);

  Mutex mutex_;
  // By their jobs; those to all stand at "".
  std::multimap<std::string, Listener> listeners_ ISOMESH_GUARDED_BY(mutex_);
};

// What a stream of events is made of.
struct EventStream {
  std::shared_ptr<Broadcaster::Mailbox> mailbox;
  std::vector<store::Event> past;       // what the listener has missed
  std::uint64_t last = 0;               // the last event that the listener has seen
  std::function<std::string()> result;  // the job that is over, as JSON
  net::FairPlaces::Place place;         // among the streams
};

// Ends with the event of the job's end. Sends at least a comment every 15 seconds, so that a client
// that is gone is noticed.
std::unique_ptr<net::Source> event_source(EventStream stream);

// What happens to all jobs of a mailbox, from now on, with the job's id in each event and without
// the finished job at its end. Ends when the listener has lost events, so that it asks how its jobs
// are and comes back. Comments as above.
std::unique_ptr<net::Source> event_source(std::shared_ptr<Broadcaster::Mailbox> mailbox,
                                          net::FairPlaces::Place place);

}  // namespace isomesh::http
