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
  // One listener's events. Progress that nobody has read is replaced by newer one, so it is never
  // long.
  class Mailbox {
   public:
    void put(const store::Event& event) ISOMESH_EXCLUDES(mutex_);
    std::optional<store::Event> take() ISOMESH_EXCLUDES(mutex_);

   private:
    Mutex mutex_;
    std::deque<store::Event> events_ ISOMESH_GUARDED_BY(mutex_);
  };

  // The mailbox gets the job's events from now on, until its last owner is gone.
  std::shared_ptr<Mailbox> listen_to(const std::string& job);

  // Puts the event into the mailboxes of its job; false when there are none.
  bool publish(const store::Event& event);

 private:
  Mutex mutex_;
  std::multimap<std::string, std::weak_ptr<Mailbox>> listeners_ ISOMESH_GUARDED_BY(mutex_);
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

}  // namespace isomesh::http
