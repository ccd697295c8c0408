// One request and its answer, as the library sees them.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>

#include <httplib.h>

#include "server/http/courier.h"
#include "server/http/doorman.h"

namespace isomesh::http {

struct ExchangeLimits {
  // Within each such time kLeastBytes of a body must come, or all of it.
  std::chrono::milliseconds patience{15'000};
};

// A request that waits for a job, to be answered later as if it had come then.
struct Parking {
  std::string job;
  std::chrono::steady_clock::time_point until;
};

// What the library reads and writes instead of a socket. It reads a request line that cannot
// surprise it, and then the body, from the connection with a limit to its slowness; the headers are
// put into its request by `introduce`, because it decodes percent signs in them and forgives too
// much. What it writes is kept, and sent by a courier. Not thread safe.
class Exchange : public httplib::Stream {
 public:
  static constexpr std::size_t kLeastBytes = 64 * 1024;

  // `stopping` ends the reading of bodies when it becomes true.
  Exchange(Visitor visitor, const ExchangeLimits& limits, const std::atomic<bool>& stopping);

  // The exchange that this thread serves, for handlers; none outside of them.
  static Exchange* current();

  // Makes an exchange current for as long as it lives.
  class Serving {
   public:
    explicit Serving(Exchange& exchange);
    ~Serving();
    Serving(const Serving&) = delete;
    Serving& operator=(const Serving&) = delete;
  };

  // Fills the request that the library has made of the request line.
  void introduce(httplib::Request& request) const;

  const Visitor& visitor() const { return visitor_; }

  // When the request had come.
  std::chrono::steady_clock::time_point began() const { return began_; }

  // Bytes of the body that have come, with its framing.
  std::uint64_t received() const { return received_; }

  // Whether all of the body is here; never for a chunked one, whose end is not known.
  bool has_whole_body() const;

  // The rest of the answer, after what was written.
  void hand_over(std::unique_ptr<Source> source) { source_ = std::move(source); }

  // Forgets what is written: the request is answered when its job is done, or later than `until`,
  // by a second run of its handler, which then finds what it was parked for in resumed().
  void park(Parking parking) { parking_ = std::move(parking); }
  const std::optional<Parking>& parking() const { return parking_; }
  // Ends the parking, for the second run.
  void resume();
  const std::optional<Parking>& resumed() const { return resumed_; }

  // Why a body could not be read to its end: because it came too slowly.
  bool was_too_slow() const { return was_too_slow_; }

  // Sends the answer, or has the courier send it. The exchange is over.
  void finish(Courier& courier);
  // The connection, for another answer than this one's. The exchange is over.
  std::unique_ptr<ByteStream> take_stream() { return std::move(visitor_.stream); }

  // What a connection that has made no valid request is told.
  static std::string error_answer(const Error& error);

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }
  ssize_t read(char* target, std::size_t size) override;
  ssize_t write(const char* bytes, std::size_t size) override;
  void get_remote_ip_and_port(std::string& ip, int& port) const override;
  void get_local_ip_and_port(std::string& ip, int& port) const override;
  // Never a descriptor: the library refuses those that select() cannot take.
  socket_t socket() const override { return 0; }

 private:
  ssize_t read_body(char* target, std::size_t size);
  void invite_body();

  Visitor visitor_;
  const ExchangeLimits limits_;
  const std::atomic<bool>& stopping_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  std::string line_;  // what the library reads for a head
  std::size_t line_read_ = 0;
  std::size_t body_read_ = 0;   // of visitor_.body
  std::uint64_t received_ = 0;  // of the body from the connection
  std::size_t since_deadline_ = 0;
  std::optional<std::chrono::steady_clock::time_point> deadline_;  // of reading, once begun
  bool invited_ = false;
  bool was_too_slow_ = false;
  std::string answer_;
  std::unique_ptr<Source> source_;
  std::optional<Parking> parking_;
  std::optional<Parking> resumed_;
};

}  // namespace isomesh::http
