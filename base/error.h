// The one exception type of the project.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh {

// Why a request or a job was refused. The number behind a code is the HTTP status
// that proto/error.h gives it.
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
  kPacsUnreachable,      // 503: a PACS gave no answer, or one that may be another next time
  kPacsRefused,          // 502: a PACS has refused what it was asked for
  kSeriesIncomplete,     // 503: a PACS has not sent all of a series (yet)
  kUnreachable,          // client side only: no answer from the server
};

// One field that is at fault, by the name that the client used for it.
struct FieldError {
  std::string field;
  std::string message;

  bool operator==(const FieldError&) const = default;
};

// A parameter by which a client can choose, where a request leaves open which of several is meant.
struct Choice {
  std::string parameter;  // of the query
  std::string value;
  std::string title;  // what it stands for, for a person

  bool operator==(const Choice&) const = default;
};

// What a client can add to a request that was refused, so that it is not refused again.
struct Remedy {
  // The code that the parameter `accept` takes, of a refusal that a person may overrule.
  std::string overridable = {};
  std::vector<Choice> choices = {};

  bool operator==(const Remedy&) const = default;
};

// Thrown by every layer. `what()` is the detail: one sentence that tells a person what is wrong,
// without a path, an address or another client's data, because it is sent as it is.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& detail) : std::runtime_error(detail), code_(code) {}
  Error(ErrorCode code, const std::string& detail, std::vector<FieldError> fields)
      : std::runtime_error(detail), code_(code), fields_(std::move(fields)) {}

  ErrorCode code() const { return code_; }
  const std::vector<FieldError>& fields() const { return fields_; }
  const Remedy& remedy() const { return remedy_; }

  // The same in other words.
  Error with_detail(const std::string& detail) const {
    return Error(code_, detail, fields_).with_remedy(remedy_);
  }
  // The same with another remedy.
  Error with_remedy(Remedy remedy) const {
    Error other = *this;
    other.remedy_ = std::move(remedy);
    return other;
  }

 private:
  ErrorCode code_;
  std::vector<FieldError> fields_;
  Remedy remedy_;
};

// kInvalidParameter with one field at fault.
Error invalid_parameter(const std::string& field, const std::string& message);

// kInvalidParameter with several; the detail names them all.
Error invalid_parameters(std::vector<FieldError> fields);

// Throws what a failed system call means: kOutOfSpace for a full disk or quota, kUnavailable where
// descriptors, memory or processes are used up, which may pass, otherwise kInternal with the call's
// name and `error_number`'s text. Never names a path, because the text is sent to clients.
[[noreturn]] void throw_system_error(std::string_view call, int error_number);

// The same for a call that names a file: kNotFound where it is not there.
[[noreturn]] void throw_file_error(std::string_view call, int error_number);

}  // namespace isomesh
