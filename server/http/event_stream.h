// What happens to jobs, told to those who listen (Server-Sent Events).
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "server/http/courier.h"
#include "server/http/slots.h"
#include "server/store/job_store.h"

namespace isomesh::http {

// Hands events on to the listeners of their jobs. Thread safe.
class Broadcaster {
 public:
  // One listener's events. Progress that nobody has read is replaced by newer one, so it is never
  // long.
  class Mailbox {
   public:
    void put(const store::Event& event);
    std::optional<store::Event> take();

   private:
    std::mutex mutex_;
    std::deque<store::Event> events_;  // guarded by mutex_
  };

  // Gets the job's events from now on, for as long as it is kept.
  std::shared_ptr<Mailbox> listen_to(const std::string& job);

  // True when somebody listens to it.
  bool publish(const store::Event& event);

 private:
  std::mutex mutex_;  // guards what follows
  std::multimap<std::string, std::weak_ptr<Mailbox>> listeners_;
};

// A stream's beginning and whence its rest comes.
struct EventStream {
  std::shared_ptr<Broadcaster::Mailbox> mailbox;
  std::vector<store::Event> past;       // what the listener has missed
  std::uint64_t last = 0;               // the last event that the listener has seen
  std::function<std::string()> result;  // the job that is over, as JSON
  Slots::Place place;                   // among the streams
};

// Ends after the job's end. Says something every 15 seconds, so that a listener who is gone is
// noticed.
std::unique_ptr<Source> event_source(EventStream stream);

}  // namespace isomesh::http
