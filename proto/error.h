// The one exception type of the project and the table that maps its codes to HTTP.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh {

// Why a request or a job was refused. Every value has one HTTP status; see `describe`.
enum class ErrorCode {
  kInvalidParameter,     // 400: a member, query parameter or header is unknown or out of range
  kDigestMismatch,       // 400: the body is not the one that its Content-Digest names
  kUnauthorized,         // 401: no token, or not one that is known
  kForbidden,            // 403: the token is for something else
  kNotFound,             // 404
  kMethodNotAllowed,     // 405
  kNotReady,             // 409: the mesh of a job that has not succeeded (yet)
  kGone,                 // 410: it was here and has expired
  kLengthRequired,       // 411
  kTooLarge,             // 413: a body, a volume or a mesh beyond what is configured or possible
  kUriTooLong,           // 414
  kUnsupportedMedia,     // 415: not a volume format, or a content encoding, that we read
  kRangeNotSatisfiable,  // 416
  kUnusableVolume,       // 422: a volume that is broken or cannot be trusted
  kKeyReused,            // 422: an idempotency key that came with another body before
  kTooManyRequests,      // 429
  kInternal,             // 500: a defect of ours; the detail is never sent to a client
  kUnavailable,          // 503: full or draining
  kOutOfSpace,           // 507
  kCancelled,            // the job was cancelled; 409 where it reaches a client
  kRequestTimeout,       // 408: a request or a body that came too slowly
  kPreconditionFailed,   // 412: what If-Match names is not what is there
  kHeadersTooLarge,      // 431
  kUnreachable,          // client side only: no answer from the server
};

// One field that is at fault, by the name that the client used for it.
struct FieldError {
  std::string field;
  std::string message;

  bool operator==(const FieldError&) const = default;
};

// What a code is called and which status it has. `name` is stable and ends the problem's `type`.
struct ErrorDescription {
  ErrorCode code;
  int status;
  std::string_view name;
  std::string_view title;
};

// Constant time; every code has a description.
const ErrorDescription& describe(ErrorCode code);

// The code with that name; kInternal for a name that this version does not know.
ErrorCode error_code_of(std::string_view name);

// Thrown by every layer. `what()` is the detail: one sentence that tells a person what is wrong,
// without a path, an address or another client's data, because it is sent as it is.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& detail) : std::runtime_error(detail), code_(code) {}
  Error(ErrorCode code, const std::string& detail, std::vector<FieldError> fields)
      : std::runtime_error(detail), code_(code), fields_(std::move(fields)) {}

  ErrorCode code() const { return code_; }
  const std::vector<FieldError>& fields() const { return fields_; }

 private:
  ErrorCode code_;
  std::vector<FieldError> fields_;
};

// kInvalidParameter with one field at fault.
Error invalid_parameter(const std::string& field, const std::string& message);

// kInvalidParameter with several; the detail names them all.
Error invalid_parameters(std::vector<FieldError> fields);

// RFC 9457 problem details: what an Error becomes on the wire.
struct Problem {
  std::string type;
  std::string title;
  int status = 0;
  std::string detail;
  std::string instance;  // the request's path or the job's; may be empty
  std::vector<FieldError> errors;

  bool operator==(const Problem&) const = default;
};

// The problem of an error. The detail of a kInternal error is replaced by a general sentence.
Problem to_problem(const Error& error, const std::string& instance);

// The inverse, for clients: an Error whose code follows from the problem's type.
Error to_error(const Problem& problem);

}  // namespace isomesh
