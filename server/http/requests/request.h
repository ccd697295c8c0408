// A request for handlers, independent of the HTTP library.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/net/request_head.h"

namespace isomesh::http {

// Identifies a request in the log: the trace of a W3C `traceparent` header, or a new one if it is
// missing or malformed, and a new span for this request.
struct Trace {
  std::string trace_id;  // 32 hexadecimal digits
  std::string span_id;   // 16

  std::string request_id() const { return trace_id + '-' + span_id; }
};

// Throws Error kInternal if the system has no random bytes.
Trace continue_trace(std::string_view traceparent);

enum class Role {
  kUser,     // its own volumes and jobs
  kAdmin,    // all volumes and jobs, and the metrics
  kMonitor,  // only the metrics
};

std::string_view to_string(Role role);
std::optional<Role> role_from(std::string_view name);

// Without tokens every caller is an unnamed administrator.
struct Caller {
  std::string name;
  Role role = Role::kAdmin;

  bool operator==(const Caller&) const = default;
};

// The route of unrouted requests in logs and metrics.
inline constexpr std::string_view kNoRoute = "none";

struct RequestContext {
  std::chrono::steady_clock::time_point began =
      std::chrono::steady_clock::now();  // when its head was read
  Trace trace;
  Caller caller;
  // The end of a provider's login; empty for the service's own tokens, and without logins.
  std::optional<std::chrono::system_clock::time_point> login_ends = {};
  std::string_view route = kNoRoute;  // the pattern of its route; lives as long as the router
};

// Reads a body, once, in its handler. Callbacks must not throw; one that returns false ends the
// reading.
class BodyReader {
 public:
  using TakePiece = std::function<bool(std::string_view piece)>;
  using BeginField = std::function<bool(const std::string& name, const std::string& file_name)>;

  virtual ~BodyReader() = default;

  // Both return false if the body was incomplete or a callback ended the reading. Read a form
  // (Request::is_form) with read_form, which calls `begin` before the pieces of each field.
  virtual bool read(const TakePiece& take) = 0;
  virtual bool read_form(const BeginField& begin, const TakePiece& take) = 0;

  // True if the whole body has arrived, so that reading does not block. False for a chunked one
  // until its end was read.
  virtual bool is_whole() const = 0;
  // True if reading ended because the body arrived too slowly, or because its chunks are malformed.
  virtual bool was_too_slow() const = 0;
  virtual bool was_malformed() const = 0;
  // True if the client closed the connection before the end of the body.
  virtual bool was_cut() const = 0;
};

using Parameters = std::vector<std::pair<std::string, std::string>>;

struct Request {
  std::string method;
  std::string target;   // path and query as sent
  std::string version;  // HTTP/1.0 or HTTP/1.1
  std::string path;     // percent-decoded, like the next two
  Parameters path_parameters;
  Parameters query;
  net::Headers headers;
  std::optional<std::uint64_t> content_length;
  std::string remote_address;  // empty for a Unix socket
  BodyReader* body = nullptr;  // only for POST, PATCH and PUT
  RequestContext context;

  bool has_header(std::string_view name) const;
  // The value of the first header of that name; empty if missing.
  std::string_view header(std::string_view name) const;
  std::size_t count_headers(std::string_view name) const;

  // The same for query parameters, whose names are case-sensitive.
  bool has_parameter(std::string_view name) const;
  std::string_view parameter(std::string_view name) const;
  std::size_t count_parameters(std::string_view name) const;

  // The part of the path at {name} in the route's pattern.
  std::string path_parameter(std::string_view name) const;

  // False if the request has no body, or an empty one.
  bool has_body() const;

  // True for a form with fields (multipart/form-data).
  bool is_form() const;
};

}  // namespace isomesh::http
