// Identifies a request in the log.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::http {

// The trace of a W3C `traceparent` header, or a new one if it is missing or malformed, and a new
// span for this request.
struct Trace {
  std::string trace_id;  // 32 hexadecimal digits
  std::string span_id;   // 16

  std::string request_id() const { return trace_id + '-' + span_id; }
};

// Throws Error kInternal if the system has no random bytes.
Trace continue_trace(std::string_view traceparent);

}  // namespace isomesh::http
