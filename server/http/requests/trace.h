// The name of one request, by which its line of the log is found again.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::http {

// The trace that a W3C `traceparent` header names, or a new one where there is none or it is
// malformed; and this request's own part of it, which is always new.
struct Trace {
  std::string trace_id;  // 32 hexadecimal digits
  std::string span_id;   // 16

  std::string request_id() const { return trace_id + '-' + span_id; }
};

// Throws Error kInternal when the system has no random bytes.
Trace continue_trace(std::string_view traceparent);

}  // namespace isomesh::http
