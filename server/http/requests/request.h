// A request as its handler sees it, whatever HTTP library has read it.
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

#include "server/http/requests/caller.h"
#include "server/http/requests/trace.h"
#include "server/net/request_head.h"

namespace isomesh::http {

// The route of a request that none was found for, in logs and metrics.
inline constexpr std::string_view kNoRoute = "none";

// What the server knows of a request beside what the client has sent.
struct RequestContext {
  std::chrono::steady_clock::time_point began =
      std::chrono::steady_clock::now();  // its head is read
  Trace trace;
  Caller caller;
  std::string_view route = kNoRoute;  // the pattern of its route, which lives as long as the router
};

// Reads a body, once, while its handler works. The functions that take the pieces must not throw;
// one that returns false ends the reading.
class BodyReader {
 public:
  using TakePiece = std::function<bool(std::string_view piece)>;
  using BeginField = std::function<bool(const std::string& name, const std::string& file_name)>;

  virtual ~BodyReader() = default;

  // Both return false when the body did not come whole or a function has ended the reading. A form
  // (Request::is_form) has to be read by read_form, which calls `begin` before the pieces of each
  // field.
  virtual bool read(const TakePiece& take) = 0;
  virtual bool read_form(const BeginField& begin, const TakePiece& take) = 0;

  // Whether the whole body is here already, so that reading it does not wait. False for a chunked
  // one, whose end is not known before.
  virtual bool is_whole() const = 0;
  // Whether reading has ended because the body came too slowly, or its chunks are none.
  virtual bool was_too_slow() const = 0;
  virtual bool was_malformed() const = 0;
};

using Parameters = std::vector<std::pair<std::string, std::string>>;

struct Request {
  std::string method;
  std::string target;   // path and query as they were sent
  std::string version;  // HTTP/1.0 or HTTP/1.1
  std::string path;     // percent signs decoded, as in the next two
  Parameters path_parameters;
  Parameters query;
  net::Headers headers;
  std::optional<std::uint64_t> content_length;
  std::string remote_address;  // empty for a Unix socket
  BodyReader* body = nullptr;  // of a POST or PATCH only
  RequestContext context;

  bool has_header(std::string_view name) const;
  // The value of the first header of that name; empty without one.
  std::string_view header(std::string_view name) const;
  std::size_t count_headers(std::string_view name) const;

  // The same for the parameters of the query, whose names have their case.
  bool has_parameter(std::string_view name) const;
  std::string_view parameter(std::string_view name) const;
  std::size_t count_parameters(std::string_view name) const;

  // The part of the path that the route's pattern has {name} for.
  std::string path_parameter(std::string_view name) const;

  // Whether the body is a form with fields (multipart/form-data).
  bool is_form() const;
};

}  // namespace isomesh::http
