#include "client/isomesh/transport.h"

#include <algorithm>
#include <ctime>
#include <memory>
#include <new>
#include <optional>
#include <utility>

#include <curl/curl.h>
#include <poll.h>

#include "base/curl.h"
#include "base/curl_transfer.h"
#include "base/text.h"

namespace isomesh {
namespace {

using std::chrono::milliseconds;

// libcurl limits each line of a response's head, but not in every version the whole head.
constexpr std::size_t kLongestHead = 64 * 1024;
// The size of a list of about ten thousand jobs.
constexpr std::size_t kLongestBody = 64 * 1024 * 1024;

constexpr int kLastStatus = 599;  // RFC 9110, 15
constexpr long kPieceBytes = 256 * 1024;
constexpr milliseconds kLongestSleep{60'000};

using curl::Easy;
using curl::Headers;
using curl::make_easy;
using curl::make_multi;
using curl::Multi;

void check(bool done) {
  if (!done) throw Error(ErrorCode::kInternal, "libcurl failed");
}

void append(Headers& headers, const std::string& name, const std::string& value) {
  // libcurl sends lines unchanged, so a line break would begin another header.
  if (has_control_characters(value)) {
    throw invalid_parameter(name, "must not contain control characters");
  }
  curl::append(headers, name + ": " + value);
}

Headers headers_of(const HttpRequest& request, const TransportOptions& options) {
  Headers headers;
  for (const auto& [name, value] : request.headers) append(headers, name, value);
  if (!options.token.empty()) append(headers, "Authorization", "Bearer " + options.token);
  return headers;
}

// Retry-After is a number of seconds or a date. The clocks of both machines may differ, so the date
// counts from that of the response.
std::chrono::seconds retry_after_of(const HttpResponse& response) {
  constexpr std::int64_t kMost = 86'400 * 365;
  const std::string value = response.header("retry-after");
  if (const auto given = parse_uint64(value)) {
    return std::chrono::seconds(std::min<std::uint64_t>(*given, kMost));
  }
  const time_t then = curl_getdate(value.c_str(), nullptr);
  if (then < 0) return {};
  const time_t sent = curl_getdate(response.header("date").c_str(), nullptr);
  const std::int64_t left = then - (sent < 0 ? std::time(nullptr) : sent);
  return std::chrono::seconds(std::clamp<std::int64_t>(left, 0, kMost));
}

bool is_broken(CURLcode code) {
  return code == CURLE_GOT_NOTHING || code == CURLE_PARTIAL_FILE || code == CURLE_RECV_ERROR ||
         code == CURLE_SEND_ERROR;
}

std::string reason_of(CURLcode code) {
  switch (code) {
    case CURLE_COULDNT_RESOLVE_HOST:
    case CURLE_COULDNT_CONNECT:
      return "cannot connect";
    case CURLE_OPERATION_TIMEDOUT:
      return "the connection timed out";
    case CURLE_SSL_CONNECT_ERROR:
      return "the TLS handshake failed";
    case CURLE_SSL_CACERT_BADFILE:
      return "the file of certificate authorities cannot be read";
    case CURLE_PEER_FAILED_VERIFICATION:
      return "its certificate is not trusted";
    default:
      return is_broken(code) ? "the connection was closed before the response was complete"
                             : "the response is not one of isomeshd's API";
  }
}

class Transfer {
 public:
  Transfer(const TransportOptions& options, const HttpRequest& request)
      : options_(options), request_(request), headers_(headers_of(request, options)) {
    set_connection();
    set_request();
    set_callbacks();
    check(curl_multi_add_handle(multi_.get(), easy_.get()) == CURLM_OK);
  }
  ~Transfer() { curl_multi_remove_handle(multi_.get(), easy_.get()); }
  Transfer(const Transfer&) = delete;
  Transfer& operator=(const Transfer&) = delete;

  HttpResponse response() {
    const std::optional<CURLcode> end = run();
    guard_.rethrow();
    if (!end) {
      if (options_.stop.stop_requested()) throw Error(ErrorCode::kCancelled, "interrupted");
      throw no_response("the server did not respond in time", is_sending());
    }
    if (*end != CURLE_OK) throw no_response(reason_of(*end), is_broken(*end));
    // libcurl accepts a truncated head.
    if (!head_is_whole_) throw no_response(reason_of(CURLE_PARTIAL_FILE), true);
    response_.status = static_cast<int>(info<long>(CURLINFO_RESPONSE_CODE));
    // libcurl 8.14 accepts the first three digits of an invalid status.
    if (response_.status > kLastStatus)
      throw no_response(reason_of(CURLE_WEIRD_SERVER_REPLY), false);
    const char* type = info<char*>(CURLINFO_CONTENT_TYPE);
    if (type != nullptr) response_.content_type = type;
    response_.retry_after = retry_after_of(response_);
    return std::move(response_);
  }

 private:
  template <class Value>
  void set(CURLoption option, Value value) {
    check(curl_easy_setopt(easy_.get(), option, value) == CURLE_OK);
  }

  template <class Value>
  Value info(CURLINFO name) const {
    Value value{};
    check(curl_easy_getinfo(easy_.get(), name, &value) == CURLE_OK);
    return value;
  }

  void set_connection() {
    set(CURLOPT_URL, (options_.server.origin + request_.target).c_str());
    set(CURLOPT_PATH_AS_IS, 1L);
    curl::connect_directly(easy_.get(), options_.authorities);
    set(CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
    // An aborted transfer does not wait for the resolver's thread.
    set(CURLOPT_QUICK_EXIT, 1L);
    set(CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(options_.connect_timeout.count()));
    if (!options_.server.socket.empty()) {
      set(CURLOPT_UNIX_SOCKET_PATH, options_.server.socket.c_str());
    }
  }

  void set_request() {
    set(CURLOPT_USERAGENT, "isomesh/" ISOMESH_VERSION);
    set(CURLOPT_HTTPHEADER, headers_.get());
    if (request_.source) {
      set(CURLOPT_POST, 1L);
      set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request_.source_bytes));
    } else if (request_.method == "POST" || request_.method == "PATCH") {
      set(CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request_.body.size()));
      set(CURLOPT_POSTFIELDS, request_.body.data());
    } else if (request_.method == "HEAD") {
      set(CURLOPT_NOBODY, 1L);
    }
    set(CURLOPT_CUSTOMREQUEST, request_.method.c_str());
    set(CURLOPT_UPLOAD_BUFFERSIZE, kPieceBytes);
    set(CURLOPT_BUFFERSIZE, kPieceBytes);
  }

  void set_callbacks() {
    set(CURLOPT_HEADERDATA, this);
    set(CURLOPT_HEADERFUNCTION, &Transfer::on_head);
    set(CURLOPT_WRITEDATA, this);
    set(CURLOPT_WRITEFUNCTION, &Transfer::on_body);
    set(CURLOPT_READDATA, this);
    set(CURLOPT_READFUNCTION, &Transfer::on_source);
  }

  // Returns the transfer's result; empty if it was aborted, because the server is silent or on a
  // stop request, which wakes the poll.
  std::optional<CURLcode> run() {
    const std::stop_callback wake(options_.stop, [this] { curl_multi_wakeup(multi_.get()); });
    while (!options_.stop.stop_requested()) {
      int running = 0;
      check(curl_multi_perform(multi_.get(), &running) == CURLM_OK);
      int left = 0;
      if (running == 0) return curl_multi_info_read(multi_.get(), &left)->data.result;
      if (std::exchange(is_paused_, false)) {
        check(curl_easy_pause(easy_.get(), CURLPAUSE_CONT) == CURLE_OK);
      }
      const milliseconds patience = patience_left();
      if (patience.count() <= 0) break;
      const auto sleep = static_cast<int>(std::min(patience, kLongestSleep).count());
      check(curl_multi_poll(multi_.get(), nullptr, 0, sleep, nullptr) == CURLM_OK);
    }
    return std::nullopt;
  }

  // The remaining time that the server may be silent. Connecting has its own time limit.
  milliseconds patience_left() {
    const auto now = std::chrono::steady_clock::now();
    const curl_off_t moved = info<curl_off_t>(CURLINFO_SIZE_UPLOAD_T) +
                             info<curl_off_t>(CURLINFO_SIZE_DOWNLOAD_T) +
                             static_cast<curl_off_t>(head_bytes_);
    const bool is_connected = info<curl_off_t>(CURLINFO_PRETRANSFER_TIME_T) > 0;
    if (!is_connected || moved != moved_) {
      moved_ = moved;
      moved_at_ = now;
    }
    milliseconds allowed =
        std::min(options_.silence_timeout, milliseconds::max() / 2) + request_.patience;
    if (is_sending()) allowed = std::min(allowed, options_.stall_timeout);
    return allowed - std::chrono::duration_cast<milliseconds>(now - moved_at_);
  }

  bool is_sending() const {
    return request_.source && info<curl_off_t>(CURLINFO_SIZE_UPLOAD_T) <
                                  static_cast<curl_off_t>(request_.source_bytes);
  }

  NoResponse no_response(const std::string& reason, bool broken) const {
    return {"no response from " + options_.server_url + ": " + reason, broken};
  }

  // Lines of the response's head, and of preceding interim responses (1xx).
  static std::size_t on_head(char* line, std::size_t, std::size_t size, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    const std::string_view text(line, size);
    transfer.head_bytes_ += size;
    if (transfer.head_bytes_ > kLongestHead) return 0;
    return transfer.guard_(0, [&] {
      transfer.take_head(trimmed(text));
      return size;
    });
  }

  static std::size_t on_body(char* bytes, std::size_t, std::size_t size, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    return transfer.guard_(0, [&] {
      transfer.take({bytes, size});
      return size;
    });
  }

  static std::size_t on_source(char* bytes, std::size_t, std::size_t size, void* self) {
    auto& transfer = *static_cast<Transfer*>(self);
    return transfer.guard_(CURL_READFUNC_ABORT, [&] { return transfer.provide({bytes, size}); });
  }

  void take_head(std::string_view line) {
    if (line.starts_with("HTTP/")) {
      head_is_whole_ = false;
      response_.headers.clear();
    } else if (line.empty()) {
      head_is_whole_ = true;
    } else {
      const std::size_t colon = std::min(line.find(':'), line.size());
      const std::string_view value = line.substr(std::min(colon + 1, line.size()));
      response_.headers.emplace_back(lower(line.substr(0, colon)), trimmed(value));
    }
  }

  void take(std::string_view piece) {
    const long status = info<long>(CURLINFO_RESPONSE_CODE);
    if (request_.sink && status >= 200 && status < 300) {
      const bool is_first = !std::exchange(sink_has_begun_, true);
      if (is_first && request_.before_sink) request_.before_sink(static_cast<int>(status));
      return request_.sink(piece);
    }
    if (response_.body.size() + piece.size() > kLongestBody) {
      throw Error(ErrorCode::kInternal, "the server's response does not match the API");
    }
    response_.body += piece;
  }

  // A server that responds during a body may close the connection, and then sending fails. So its
  // response is read before more is sent.
  std::size_t provide(std::span<char> space) {
    const std::uint64_t left = request_.source_bytes - provided_;
    const auto size = static_cast<std::size_t>(std::min<std::uint64_t>(left, space.size()));
    if (size == 0) return 0;
    request_.source(provided_, space.first(size));
    is_paused_ = server_speaks();
    if (is_paused_) return CURL_READFUNC_PAUSE;
    provided_ += size;
    return size;
  }

  bool server_speaks() const {
    const auto socket = info<curl_socket_t>(CURLINFO_ACTIVESOCKET);
    pollfd descriptor{.fd = socket, .events = POLLIN, .revents = 0};
    return socket != CURL_SOCKET_BAD && ::poll(&descriptor, 1, 0) > 0;
  }

  const TransportOptions& options_;
  const HttpRequest& request_;
  Headers headers_;
  Multi multi_ = make_multi();  // before the easy handle, because it initialises libcurl
  Easy easy_ = make_easy();

  HttpResponse response_;
  curl::Guard guard_;
  std::uint64_t provided_ = 0;
  bool sink_has_begun_ = false;
  bool is_paused_ = false;  // the source waits until the response was read
  std::size_t head_bytes_ = 0;
  bool head_is_whole_ = false;
  curl_off_t moved_ = 0;  // bytes, in both directions
  std::chrono::steady_clock::time_point moved_at_ = std::chrono::steady_clock::now();
};

}  // namespace

std::string HttpResponse::header(std::string_view name) const {
  const auto found = std::ranges::find(headers, name, &std::pair<std::string, std::string>::first);
  return found == headers.end() ? std::string() : found->second;
}

HttpResponse Transport::send(const HttpRequest& request) const {
  return Transfer(options_, request).response();
}

}  // namespace isomesh
