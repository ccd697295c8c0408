#include "client/isomesh/transport.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <exception>
#include <memory>

#include <httplib.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>

namespace isomesh {
namespace {

using std::chrono::milliseconds;

// cpp-httplib reads the lines of an answer's head one byte at a time into memory without a bound,
// and matches the first with a recursive regular expression: an endless line would end the process.
constexpr std::size_t kLongestLine = 4096;
constexpr std::size_t kLongestHead = 64 * 1024;
// A list of some ten thousand jobs.
constexpr std::size_t kLongestBody = 64 * 1024 * 1024;

constexpr std::size_t kPieceBytes = 256 * 1024;
constexpr milliseconds kStopInterval{50};

// What happened on the wire of one exchange, beyond what cpp-httplib reports.
struct Wire {
  milliseconds silence{0};
  std::stop_token stop = {};
  bool answered_early = false;
  bool broken = false;
  std::string failure = {};
};

// A connected socket, plain or TLS, with bounds on time and on the length of lines.
class GuardedStream final : public httplib::Stream {
 public:
  GuardedStream(int socket, SSL* ssl, Wire& wire) : socket_(socket), ssl_(ssl), wire_(wire) {}

  bool is_readable() const override { return true; }
  bool is_writable() const override { return true; }

  ssize_t read(char* target, size_t size) override {
    if (begin_ == end_ && !refill()) return end_of_stream_ ? 0 : -1;
    const std::size_t count = std::min(size, end_ - begin_);
    std::memcpy(target, buffer_.data() + begin_, count);
    begin_ += count;
    return within_bounds(*target, size) ? static_cast<ssize_t>(count) : -1;
  }

  ssize_t write(const char* source, size_t size) override {
    const auto whole = static_cast<ssize_t>(size);
    if (wire_.answered_early) return whole;
    const int events = wait_for(POLLOUT | (ssl_ ? 0 : POLLIN));
    if (events == 0) return -1;
    // A server that speaks now has heard enough. What is left to send is dropped here, so that
    // cpp-httplib goes on to read the answer.
    if (!ssl_ && (events & (POLLIN | POLLERR | POLLHUP)) != 0) {
      wire_.answered_early = true;
      return whole;
    }
    const ssize_t count = send_some(source, size);
    if (count > 0) return count;
    wire_.answered_early = true;
    return whole;
  }

  void get_remote_ip_and_port(std::string&, int&) const override {}
  void get_local_ip_and_port(std::string&, int&) const override {}
  socket_t socket() const override { return socket_; }

 private:
  ssize_t send_some(const char* source, size_t size) {
    if (ssl_) return SSL_write(ssl_, source, static_cast<int>(std::min(size, kPieceBytes)));
    // Never blocks: the socket was found writable, and a full buffer takes a part.
    ssize_t count = 0;
    do {
      count = ::send(socket_, source, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    } while (count < 0 && errno == EINTR);
    return count;
  }

  bool refill() {
    if (!(ssl_ && SSL_pending(ssl_) > 0) && wait_for(POLLIN) == 0) return false;
    ssize_t count = 0;
    do {
      count = ssl_ ? SSL_read(ssl_, buffer_.data(), static_cast<int>(buffer_.size()))
                   : ::recv(socket_, buffer_.data(), buffer_.size(), 0);
    } while (count < 0 && !ssl_ && errno == EINTR);
    if (ssl_ && count < 0 &&
        SSL_get_error(ssl_, static_cast<int>(count)) == SSL_ERROR_ZERO_RETURN) {
      count = 0;
    }
    end_of_stream_ = count == 0;
    if (count <= 0) {
      wire_.broken = true;
      wire_.failure = "the connection was closed before the answer was complete";
      return false;
    }
    begin_ = 0;
    end_ = static_cast<std::size_t>(count);
    return true;
  }

  // The events that came, or 0 when the time is over or the caller has asked to stop.
  int wait_for(int events) {
    const auto deadline = std::chrono::steady_clock::now() + wire_.silence;
    while (!wire_.stop.stop_requested()) {
      pollfd descriptor{.fd = socket_, .events = static_cast<short>(events), .revents = 0};
      const int ready = ::poll(&descriptor, 1, static_cast<int>(kStopInterval.count()));
      if (ready > 0) return descriptor.revents;
      if (ready < 0 && errno != EINTR) break;
      if (std::chrono::steady_clock::now() > deadline) {
        wire_.failure = "the server was silent for too long";
        break;
      }
    }
    return 0;
  }

  // Only lines are read byte by byte; see kLongestLine.
  bool within_bounds(char byte, std::size_t asked) {
    if (asked > 1) {
      line_ = head_ = 0;
      return true;
    }
    line_ = byte == '\n' ? 0 : line_ + 1;
    ++head_;
    if (line_ <= kLongestLine && head_ <= kLongestHead) return true;
    wire_.failure = "what answers there does not speak this API";
    return false;
  }

  int socket_;
  SSL* ssl_;
  Wire& wire_;
  std::array<char, 16 * 1024> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  bool end_of_stream_ = false;
  std::size_t line_ = 0;
  std::size_t head_ = 0;
};

// cpp-httplib's client over a GuardedStream.
template <class Base>
class GuardedClient final : public Base {
 public:
  GuardedClient(const std::string& host, int port, Wire& wire) : Base(host, port), wire_(wire) {}

 private:
  bool process_socket(const typename Base::Socket& socket,
                      std::function<bool(httplib::Stream&)> callback) override {
    GuardedStream stream(socket.sock, socket.ssl, wire_);
    return callback(stream);
  }

  Wire& wire_;
};

std::unique_ptr<httplib::ClientImpl> connect_to(const TransportOptions& options, Wire& wire) {
  using Plain = GuardedClient<httplib::ClientImpl>;
  using Tls = GuardedClient<httplib::SSLClient>;
  const ServerAddress& server = options.server;
  std::unique_ptr<httplib::ClientImpl> client;
  switch (server.kind) {
    case ServerAddress::Kind::kHttp:
      client = std::make_unique<Plain>(server.host, server.port, wire);
      break;
    case ServerAddress::Kind::kHttps: {
      auto tls = std::make_unique<Tls>(server.host, server.port, wire);
      if (!options.authorities.empty()) tls->set_ca_cert_path(options.authorities);
      client = std::move(tls);
      break;
    }
    case ServerAddress::Kind::kUnix:
      client = std::make_unique<Plain>(server.host, server.port, wire);
      client->set_address_family(AF_UNIX);
      break;
  }
  client->set_connection_timeout(options.connect_timeout);
  client->set_read_timeout(wire.silence);
  client->set_write_timeout(wire.silence);
  client->set_url_encode(false);
  client->set_decompress(false);
  client->set_tcp_nodelay(server.kind != ServerAddress::Kind::kUnix);
  return client;
}

std::string reason_of(httplib::Error error, const Wire& wire) {
  switch (error) {
    case httplib::Error::Connection:
      return "it cannot be connected to";
    case httplib::Error::ConnectionTimeout:
      return "it does not answer to connecting";
    case httplib::Error::SSLConnection:
      return "it does not speak TLS";
    case httplib::Error::SSLLoadingCerts:
      return "the certificate authorities to trust cannot be read";
    case httplib::Error::SSLServerVerification:
      return "its certificate is not one that is trusted here";
    default:
      return wire.failure.empty() ? "what answers there does not speak this API" : wire.failure;
  }
}

// The callbacks of one exchange. They must not throw through cpp-httplib, which would be left in
// the middle of its bookkeeping.
class Callbacks {
 public:
  Callbacks(const Exchange& exchange, const Wire& wire, Answer& answer)
      : exchange_(exchange), wire_(wire), answer_(answer) {}

  void attach(httplib::Request& request) {
    request.response_handler = [this](const httplib::Response& response) {
      successful_ = response.status >= 200 && response.status < 300;
      return true;
    };
    request.content_receiver = [this](const char* data, size_t size, uint64_t, uint64_t) {
      return guarded([&] { receive({data, size}); });
    };
    if (!exchange_.source) return;
    request.content_length_ = exchange_.source_bytes;
    request.content_provider_ = [this](size_t offset, size_t length, httplib::DataSink& sink) {
      return guarded([&] { provide(offset, length, sink); });
    };
  }

  void rethrow() const {
    if (failure_) std::rethrow_exception(failure_);
  }

 private:
  bool guarded(const std::function<void()>& action) {
    try {
      action();
      return true;
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }

  void receive(std::string_view piece) {
    if (successful_ && exchange_.sink) return exchange_.sink(piece);
    if (answer_.body.size() + piece.size() > kLongestBody) {
      throw Error(ErrorCode::kInternal, "the server's answer is not what the API describes");
    }
    answer_.body += piece;
  }

  void provide(std::uint64_t offset, std::uint64_t length, httplib::DataSink& sink) {
    piece_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(length, kPieceBytes)));
    if (!wire_.answered_early) exchange_.source(offset, piece_);
    sink.write(piece_.data(), piece_.size());
  }

  const Exchange& exchange_;
  const Wire& wire_;
  Answer& answer_;
  std::vector<char> piece_;
  bool successful_ = false;
  std::exception_ptr failure_;
};

httplib::Request request_of(const Exchange& exchange, const TransportOptions& options) {
  httplib::Request request;
  request.method = exchange.method;
  request.path = exchange.target;
  request.body = exchange.body;
  for (const auto& [name, value] : exchange.headers) request.set_header(name, value);
  request.set_header("User-Agent", "isomesh/" ISOMESH_VERSION);
  if (!options.token.empty()) request.set_header("Authorization", "Bearer " + options.token);
  // cpp-httplib would send the socket's path.
  if (options.server.kind == ServerAddress::Kind::kUnix) request.set_header("Host", "localhost");
  return request;
}

}  // namespace

Answer Transport::send(const Exchange& exchange) const {
  Wire wire{.silence = options_.silence_timeout + exchange.patience, .stop = options_.stop};
  Answer answer;
  Callbacks callbacks(exchange, wire, answer);
  httplib::Request request = request_of(exchange, options_);
  callbacks.attach(request);

  httplib::Response response;
  auto error = httplib::Error::Success;
  const bool answered = connect_to(options_, wire)->send(request, response, error);
  callbacks.rethrow();
  if (!answered) {
    if (options_.stop.stop_requested()) throw Error(ErrorCode::kCancelled, "interrupted");
    throw NoAnswer("no answer from " + options_.server_url + ": " + reason_of(error, wire),
                   wire.broken);
  }
  answer.status = response.status;
  answer.content_type = response.get_header_value("Content-Type");
  return answer;
}

}  // namespace isomesh
