#include "proto/error.h"

#include <algorithm>
#include <array>
#include <utility>

namespace isomesh {
namespace {

constexpr std::string_view kTypePrefix = "urn:isomesh:problem:";

constexpr std::array kDescriptions = {
    ErrorDescription{ErrorCode::kInvalidParameter, 400, "invalid-parameter", "Invalid parameter"},
    ErrorDescription{ErrorCode::kDigestMismatch, 400, "digest-mismatch",
                     "The body does not match its digest"},
    ErrorDescription{ErrorCode::kUnauthorized, 401, "unauthorized", "Not authorized"},
    ErrorDescription{ErrorCode::kForbidden, 403, "forbidden", "Not allowed"},
    ErrorDescription{ErrorCode::kNotFound, 404, "not-found", "Not found"},
    ErrorDescription{ErrorCode::kMethodNotAllowed, 405, "method-not-allowed", "Method not allowed"},
    ErrorDescription{ErrorCode::kNotReady, 409, "not-ready", "Not ready"},
    ErrorDescription{ErrorCode::kGone, 410, "gone", "Expired"},
    ErrorDescription{ErrorCode::kLengthRequired, 411, "length-required", "Length required"},
    ErrorDescription{ErrorCode::kTooLarge, 413, "too-large", "Too large"},
    ErrorDescription{ErrorCode::kUriTooLong, 414, "uri-too-long", "Request target too long"},
    ErrorDescription{ErrorCode::kUnsupportedMedia, 415, "unsupported-media",
                     "Unsupported media type"},
    ErrorDescription{ErrorCode::kRangeNotSatisfiable, 416, "range-not-satisfiable",
                     "Range not satisfiable"},
    ErrorDescription{ErrorCode::kUnusableVolume, 422, "unusable-volume",
                     "The volume cannot be used"},
    ErrorDescription{ErrorCode::kEmptySurface, 422, "empty-surface", "The surface is empty"},
    ErrorDescription{ErrorCode::kKeyReused, 422, "key-reused",
                     "The idempotency key was used for another request"},
    ErrorDescription{ErrorCode::kTooManyRequests, 429, "too-many-requests", "Too many requests"},
    ErrorDescription{ErrorCode::kInternal, 500, "internal", "Internal error"},
    ErrorDescription{ErrorCode::kUnavailable, 503, "unavailable", "Unavailable"},
    ErrorDescription{ErrorCode::kOutOfSpace, 507, "out-of-space", "Out of space"},
    ErrorDescription{ErrorCode::kCancelled, 409, "cancelled", "Cancelled"},
    ErrorDescription{ErrorCode::kRequestTimeout, 408, "request-timeout", "Request timeout"},
    ErrorDescription{ErrorCode::kPreconditionFailed, 412, "precondition-failed",
                     "Precondition failed"},
    ErrorDescription{ErrorCode::kHeadersTooLarge, 431, "headers-too-large", "Headers too large"},
    ErrorDescription{ErrorCode::kUnreachable, 503, "unreachable", "The server cannot be reached"},
    ErrorDescription{ErrorCode::kPacsUnreachable, 503, "pacs-unreachable",
                     "The PACS cannot be reached"},
    ErrorDescription{ErrorCode::kPacsRefused, 502, "pacs-refused", "The PACS rejected the request"},
    ErrorDescription{ErrorCode::kSeriesIncomplete, 503, "series-incomplete",
                     "The series is incomplete"},
};

}  // namespace

std::span<const ErrorDescription> error_descriptions() { return kDescriptions; }

const ErrorDescription& describe(ErrorCode code) {
  return *std::ranges::find(kDescriptions, code, &ErrorDescription::code);
}

ErrorCode error_code_of(std::string_view name) {
  const auto* found = std::ranges::find(kDescriptions, name, &ErrorDescription::name);
  return found == kDescriptions.end() ? ErrorCode::kInternal : found->code;
}

ErrorCode error_code_of_status(int status) {
  const auto* found = std::ranges::find(kDescriptions, status, &ErrorDescription::status);
  return found == kDescriptions.end() ? ErrorCode::kInternal : found->code;
}

Problem to_problem(const Error& error, const std::string& instance) {
  const ErrorDescription& row = describe(error.code());
  const bool ours = error.code() == ErrorCode::kInternal;
  return {.type = std::string(kTypePrefix) + std::string(row.name),
          .title = std::string(row.title),
          .status = row.status,
          .detail = ours ? "The service failed on this request; its log has the reason."
                         : std::string(error.what()),
          .instance = instance,
          .errors = error.fields(),
          .remedy = error.remedy()};
}

Error to_error(const Problem& problem) {
  const std::string_view type = problem.type;
  const ErrorCode code = type.starts_with(kTypePrefix)
                             ? error_code_of(type.substr(kTypePrefix.size()))
                             : ErrorCode::kInternal;
  Error error(code, problem.detail.empty() ? problem.title : problem.detail, problem.errors);
  return error.with_remedy(problem.remedy);
}

}  // namespace isomesh
