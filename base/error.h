// The one exception type of the project.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isomesh {

// The reason of an error. The number behind a code is the HTTP status in proto/error.h.
enum class ErrorCode {
  kInvalidParameter,     // 400: a member, query parameter or header is unknown or out of range
  kDigestMismatch,       // 400: the body does not match its Content-Digest
  kUnauthorized,         // 401: no token, or an unknown one
  kForbidden,            // 403: the token does not allow this
  kNotFound,             // 404
  kMethodNotAllowed,     // 405
  kNotReady,             // 409: the job of the requested mesh has not succeeded (yet)
  kGone,                 // 410: it has expired
  kLengthRequired,       // 411
  kTooLarge,             // 413: a body, a volume or a mesh beyond a configured or technical limit
  kUriTooLong,           // 414
  kUnsupportedMedia,     // 415: not a supported volume format or content encoding
  kRangeNotSatisfiable,  // 416
  kUnusableVolume,       // 422: a volume that is corrupt or ambiguous
  kEmptySurface,         // 422: the mesh has no triangles, and the request does not accept that
  kKeyReused,            // 422: an idempotency key that was used with another body
  kTooManyRequests,      // 429
  kInternal,             // 500: a bug; clients never see the detail
  kUnavailable,          // 503: full or draining
  kOutOfSpace,           // 507
  kCancelled,            // the job was cancelled; 409 for clients
  kRequestTimeout,       // 408: a request or a body that arrives too slowly
  kPreconditionFailed,   // 412: If-Match does not match the present state
  kHeadersTooLarge,      // 431
  kPacsUnreachable,      // 503: a PACS did not respond, or failed temporarily
  kPacsRefused,          // 502: a PACS rejected the request
  kSeriesIncomplete,     // 503: a PACS has not sent all of a series (yet)
  kUnreachable,          // client side only: no response from the server
};

// An invalid field, by the name that the client used for it.
struct FieldError {
  std::string field;
  std::string message;

  bool operator==(const FieldError&) const = default;
};

// A small grey picture, with a byte for each pixel, row by row, in base64.
struct ChoicePicture {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::string grey = {};

  bool operator==(const ChoicePicture&) const = default;
};

// The facts that tell series apart, in DICOM's forms; empty where a file does not say.
struct SeriesFacts {
  std::string patient_name = {};
  std::string patient_id = {};
  std::string study_uid = {};
  std::string study_description = {};
  std::string study_date = {};

  bool operator==(const SeriesFacts&) const = default;
};

// A parameter that resolves an ambiguous request.
struct Choice {
  std::string parameter;
  std::string value;
  std::string title;                          // of this choice, for a person
  std::optional<SeriesFacts> series = {};     // of DICOM images
  std::optional<ChoicePicture> picture = {};  // of a slice in the middle

  bool operator==(const Choice&) const = default;
};

// Additions to a rejected request that would make it succeed.
struct Remedy {
  // The value of the parameter `accept` that overrides this error; empty if none does.
  std::string overridable = {};
  std::vector<Choice> choices = {};

  bool operator==(const Remedy&) const = default;
};

// Thrown by every layer. `what()` is the detail: one sentence about the error for a person. It is
// sent to clients, so it has no path, no address and no other client's data.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, const std::string& detail) : std::runtime_error(detail), code_(code) {}
  Error(ErrorCode code, const std::string& detail, std::vector<FieldError> fields)
      : std::runtime_error(detail), code_(code), fields_(std::move(fields)) {}

  ErrorCode code() const { return code_; }
  const std::vector<FieldError>& fields() const { return fields_; }
  const Remedy& remedy() const { return remedy_; }
  // The pause before a retry that the other side asked for (Retry-After); 0: none.
  std::chrono::seconds retry_after() const { return retry_after_; }

  Error with_detail(const std::string& detail) const {
    return Error(code_, detail, fields_).with_remedy(remedy_).with_retry_after(retry_after_);
  }
  Error with_remedy(Remedy remedy) const {
    Error other = *this;
    other.remedy_ = std::move(remedy);
    return other;
  }
  Error with_retry_after(std::chrono::seconds pause) const {
    Error other = *this;
    other.retry_after_ = pause;
    return other;
  }

 private:
  ErrorCode code_;
  std::vector<FieldError> fields_;
  Remedy remedy_;
  std::chrono::seconds retry_after_{0};
};

Error invalid_parameter(const std::string& field, const std::string& message);

// kInvalidParameter with several invalid fields; the detail names them all.
Error invalid_parameters(std::vector<FieldError> fields);

// Maps a failed system call to an Error: kOutOfSpace for a full disk or quota; kUnavailable if
// descriptors, memory or processes are exhausted, which is temporary; otherwise kInternal with the
// call's name and `error_number`'s text. Never names a path, because clients see the text.
[[noreturn]] void throw_system_error(std::string_view call, int error_number);

// As throw_system_error for a call that names a file: kNotFound if the file does not exist.
[[noreturn]] void throw_file_error(std::string_view call, int error_number);

}  // namespace isomesh
