// Sends answers at their receivers' pace, all from one thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/http/byte_stream.h"
#include "server/http/wakeup.h"

struct epoll_event;

namespace isomesh::http {

// The rest of an answer, made while it is sent. Used by one thread at a time.
class Source {
 public:
  enum class More {
    kBytes,   // some were appended
    kLater,   // none at the moment; ask again after Courier::wake or a second
    kEnd,     // the answer is complete
    kBroken,  // it cannot be completed; the connection is cut, so that the receiver knows
  };

  virtual ~Source() = default;

  // Appends some tens of kilobytes. Must not block for long: all receivers wait.
  virtual More next(std::string& bytes) = 0;

  // Whether a receiver that ends its own sending is taken for gone: one that waits for events is,
  // one that downloads a file may have said all that it wanted.
  virtual bool ends_with_reader() const { return false; }
};

// An answer on its way.
struct Delivery {
  std::unique_ptr<ByteStream> stream;
  std::string bytes;               // what is sent first
  std::unique_ptr<Source> source;  // what follows; may be empty
};

struct CourierLimits {
  std::size_t most_deliveries = 1024;  // the longest there goes when there is one more
  // Within each such time a receiver must take kLeastBytes or all that there is.
  std::chrono::milliseconds patience{30'000};
  // How long the other side may go on sending after the answer: closing at once would destroy what
  // it has not read yet.
  std::chrono::milliseconds linger{2'000};
};

// All functions are thread safe.
class Courier {
 public:
  static constexpr std::size_t kLeastBytes = 32 * 1024;

  explicit Courier(const CourierLimits& limits);
  // As stop() without patience.
  ~Courier();
  Courier(const Courier&) = delete;
  Courier& operator=(const Courier&) = delete;

  void send(Delivery delivery);

  // Something has happened: sources that had nothing are asked again.
  void wake();

  std::size_t deliveries() const { return count_; }

  // Ends when all is sent, or after `patience`; sources that have nothing are cut off. Nothing is
  // taken any more.
  void stop(std::chrono::milliseconds patience);

 private:
  using Clock = std::chrono::steady_clock;
  enum class Phase { kSending, kLingering };

  struct Parcel {
    Delivery delivery;
    std::size_t sent = 0;  // of delivery.bytes
    Phase phase = Phase::kSending;
    bool waits_for_source = false;
    bool is_watched = false;
    std::size_t since_deadline = 0;  // bytes that were taken since the deadline was set
    std::size_t ignored = 0;         // bytes that came after the answer
    Clock::time_point deadline;
    unsigned events = 0;  // what epoll watches for
  };
  using Parcels = std::list<Parcel>;

  void work();
  Clock::time_point take_in();
  void serve_event(const epoll_event& event);
  void serve(Parcels::iterator parcel, unsigned events);
  void ask_sources();
  void close_overdue();
  bool send_some(Parcel& parcel);
  bool refill(Parcel& parcel);
  bool read_on(Parcel& parcel);
  bool watch(Parcel& parcel);
  void close(Parcels::iterator parcel);

  const CourierLimits limits_;
  const int epoll_;
  Wakeup wakeup_;
  std::atomic<std::size_t> count_ = 0;
  std::mutex mutex_;  // guards the next three
  std::vector<Delivery> arrived_;
  bool woken_ = false;
  Clock::time_point end_ = Clock::time_point::max();
  Parcels parcels_;  // of the thread alone, as what follows; oldest first
  bool ending_ = false;
  std::jthread thread_;  // last: joined first
};

}  // namespace isomesh::http
