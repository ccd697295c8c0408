// Sends responses as fast as their receivers take them, all from one thread.
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
#include "server/net/byte_stream.h"
#include "server/net/task_queue.h"
#include "server/net/wakeup.h"

struct epoll_event;

namespace isomesh::net {

// The rest of a response, made while it is sent. Used by one thread at a time.
class Source {
 public:
  enum class More {
    kBytes,   // some were appended, or it is to be asked again at once, to compute them
    kLater,   // none at the moment; ask again after Sender::wake or a second
    kEnd,     // the response is complete
    kBroken,  // it cannot be completed; the connection is cut, so that the receiver knows
  };

  virtual ~Source() = default;

  // Appends some tens of kilobytes. Must not block for long: all receivers wait, or those of other
  // sources that compute. What it throws is logged, and taken as kBroken.
  virtual More next(std::string& bytes) = 0;

  // Whether next() does more than to copy what is there. Then it is called by threads of their own,
  // so that those who receive what is there already do not wait for it.
  virtual bool computes() const { return false; }

  // Whether a client that ends its own sending counts as gone. One that waits for events is gone;
  // one that downloads a file may have sent all that it had to send.
  virtual bool ends_with_reader() const { return false; }
};

// The bytes of a response and the connection that they go to.
struct Response {
  std::unique_ptr<ByteStream> stream;
  std::string bytes;               // what is sent first
  std::unique_ptr<Source> source;  // what follows; may be empty
  std::string party = {};          // whom it is for, among those that share the computing threads
  bool is_refusal = false;         // little is lost when the connection is let go of
};

struct SenderLimits {
  // Refusals, and connections whose response is written and that linger; with one more the oldest
  // is closed. Responses on their way are not counted: who holds a place keeps it.
  std::size_t most_parting = 128;
  std::size_t computing_threads = 4;
  // Within each such time a receiver must take kLeastBytes or all that there is.
  std::chrono::milliseconds patience{30'000};
  // How long the other side may go on sending after the response. Closing a connection with bytes
  // that nobody has read makes the kernel reset it, and the client may lose the response.
  std::chrono::milliseconds linger{2'000};
};

// All functions are thread safe.
class Sender {
 public:
  static constexpr std::size_t kLeastBytes = 32 * 1024;

  explicit Sender(const SenderLimits& limits);
  // As stop() without patience.
  ~Sender();
  Sender(const Sender&) = delete;
  Sender& operator=(const Sender&) = delete;

  // Writes what the connection takes at once, in the thread that calls, and leaves the rest to the
  // sender's. `request_is_whole` says that no more of the request is to come, so that a connection
  // whose response is written can be closed here.
  void send(Response response, bool request_is_whole) ISOMESH_EXCLUDES(mutex_);

  // Asks sources again that had nothing: something has happened.
  void wake() ISOMESH_EXCLUDES(mutex_);

  // Responses that the sender's thread is busy with.
  std::size_t sending() const { return count_; }

  // The memory that those hold, without what sources make on the way.
  std::size_t held_bytes() const { return held_bytes_; }

  // Ends when all is sent, or after `patience`; sources that have nothing are cut off. Nothing is
  // taken any more.
  void stop(std::chrono::milliseconds patience) ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  enum class Phase { kSending, kLingering };

  struct Sending {
    std::uint64_t id = 0;  // to epoll and to the computing threads
    Response response;
    std::size_t sent = 0;  // of response.bytes
    std::size_t held = 0;  // of response.bytes as they came, until all are sent
    Phase phase = Phase::kSending;
    bool waits_for_source = false;
    bool is_computed = false;        // its source is with a computing thread
    bool is_parting = false;         // in the list of those
    bool is_watched = false;         // by epoll
    std::size_t since_deadline = 0;  // bytes that were taken since the deadline was set
    std::size_t ignored = 0;         // bytes that came after the response
    Clock::time_point deadline;
    unsigned events = 0;  // what epoll watches for
  };
  using SendingList = std::list<Sending>;
  // What a computing thread has made, with the source that it gives back.
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
  const int epoll_;
  Wakeup wakeup_;
  std::atomic<std::size_t> count_ = 0;
  std::atomic<std::size_t> held_bytes_ = 0;
  Mutex mutex_;
  std::vector<Response> arrived_ ISOMESH_GUARDED_BY(mutex_);
  std::vector<Computed> computed_ ISOMESH_GUARDED_BY(mutex_);
  bool woken_ ISOMESH_GUARDED_BY(mutex_) = false;
  Clock::time_point end_ ISOMESH_GUARDED_BY(mutex_) = Clock::time_point::max();
  // Only the sender's thread touches the next five.
  SendingList sending_;  // oldest first, as the next
  SendingList parting_;
  std::unordered_map<std::uint64_t, SendingList::iterator> by_id_;
  std::uint64_t last_id_ = 0;
  bool ending_ = false;
  BoundedTaskQueue computing_;
  std::jthread thread_;  // declared last, so that it ends before what it uses
};

}  // namespace isomesh::net
