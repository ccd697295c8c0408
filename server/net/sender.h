// Sends responses at their receivers' pace, all on one thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <string>
#include <string_view>
#include <thread>
#include <unordered_map>
#include <vector>

#include "base/mutex.h"
#include "base/wakeup.h"
#include "server/net/byte_stream.h"
#include "server/net/task_queue.h"

struct epoll_event;

namespace isomesh::net {

// Produces the rest of a response while it is sent. Used by one thread at a time.
class Source {
 public:
  enum class More {
    kBytes,  // bytes were appended, or call again at once, to compute them
    kLater,  // none now; call again after Sender::wake or a second
    kEnd,
    kBroken,  // failed; the connection is cut to tell the receiver
  };

  virtual ~Source() = default;

  // Appends tens of kilobytes. Must not block for long: all receivers wait, or all computing
  // sources. An exception is logged and means kBroken.
  virtual More next(std::string& bytes) = 0;

  // True if next() does more than copying. Then computing threads call it, so that other receivers
  // do not wait.
  virtual bool computes() const { return false; }

  // True if a client that closes its sending direction counts as disconnected. This holds for
  // listeners to events, but a client that downloads a file may have nothing more to send.
  virtual bool ends_with_reader() const { return false; }
};

struct Response {
  std::unique_ptr<ByteStream> stream;
  std::string bytes;               // sent first
  std::unique_ptr<Source> source;  // sent next; may be empty
  std::string party = {};          // for fair sharing of the computing threads
  bool is_refusal = false;         // may be closed early with little loss
};

struct SenderLimits {
  // Limit of rejected connections and lingering ones with a complete response; beyond it the oldest
  // is closed. Responses in transit do not count, because their places are limited.
  std::size_t most_parting = 128;
  std::size_t computing_threads = 4;
  // In each period of this length a receiver must take kLeastBytes or all available bytes.
  std::chrono::milliseconds patience{30'000};
  // Time limit for the peer's bytes after the response. Closing a connection with unread bytes
  // makes the kernel reset it, and the client may lose the response.
  std::chrono::milliseconds linger{2'000};
};

class Sender {
 public:
  static constexpr std::size_t kLeastBytes = 32 * 1024;

  explicit Sender(const SenderLimits& limits);
  // Calls stop() with zero patience.
  ~Sender();
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  // Writes as much as the connection takes at once, on the calling thread, and leaves the rest to
  // the sender's thread. If `request_is_whole`, no bytes of the request follow, so a complete
  // connection can be closed here.
  void send(Response response, bool request_is_whole) ISOMESH_EXCLUDES(mutex_);

  // Polls sources that had nothing to send.
  void wake() ISOMESH_EXCLUDES(mutex_);

  // Responses handled by the sender's thread.
  std::size_t sending() const { return count_; }

  // Their memory, without bytes from sources.
  std::size_t held_bytes() const { return held_bytes_; }

  // Ends when all is sent, or after `patience`; idle sources are cut off. Takes no further
  // responses.
  void stop(std::chrono::milliseconds patience) ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  enum class Phase { kSending, kLingering };

  struct Sending {
    std::uint64_t id = 0;  // for epoll and the computing threads
    Response response;
    std::size_t sent = 0;  // of response.bytes
    std::size_t held = 0;  // initial size of response.bytes, until all are sent
    Phase phase = Phase::kSending;
    bool waits_for_source = false;
    bool is_computed = false;  // a computing thread has its source
    bool is_parting = false;   // in parting_
    bool is_watched = false;
    std::size_t since_deadline = 0;  // bytes taken since the deadline was set
    std::size_t ignored = 0;         // bytes received after the response
    Clock::time_point deadline;
    unsigned events = 0;  // that epoll watches
  };
  using SendingList = std::list<Sending>;
  // The bytes from a computing thread, and the source it returns.
  struct Computed {
    std::uint64_t id = 0;
    std::unique_ptr<Source> source;
    Source::More more = Source::More::kBroken;
    std::string bytes;
  };

  void work();
  Clock::time_point take_arrived() ISOMESH_EXCLUDES(mutex_);
  void begin(Response response);
  void take_computed(Computed computed);
  void compute(std::uint64_t id, std::unique_ptr<Source> source, std::string bytes)
      ISOMESH_EXCLUDES(mutex_);
  void serve_event(const epoll_event& event);
  void go_on(SendingList::iterator sending, unsigned events);
  void ask_sources();
  void close_overdue();
  bool send_some(Sending& sending);
  bool refill(Sending& sending);
  void let_go(Sending& sending);
  bool go_on_with(Sending& sending, Source::More more);
  bool have_computed(Sending& sending);
  void part(Sending& sending);
  bool ignore_input(Sending& sending);
  bool watch(Sending& sending);
  void close(SendingList::iterator sending);

  const SenderLimits limits_;
  const Descriptor epoll_;
  Wakeup wakeup_;
  std::atomic<std::size_t> count_ = 0;
  std::atomic<std::size_t> held_bytes_ = 0;
  Mutex mutex_;
  std::vector<Response> arrived_ ISOMESH_GUARDED_BY(mutex_);
  std::vector<Computed> computed_ ISOMESH_GUARDED_BY(mutex_);
  bool woken_ ISOMESH_GUARDED_BY(mutex_) = false;
  Clock::time_point end_ ISOMESH_GUARDED_BY(mutex_) = Clock::time_point::max();
  // The next five are used on the sender's thread only.
  SendingList sending_;  // oldest first, like the next
  SendingList parting_;
  std::unordered_map<std::uint64_t, SendingList::iterator> by_id_;
  std::uint64_t last_id_ = 0;
  bool ending_ = false;
  BoundedTaskQueue computing_;
  std::jthread thread_;  // last, so that it ends before the members it uses
};

}  // namespace isomesh::net
