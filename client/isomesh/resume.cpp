// Resumable uploads: "Resumable Uploads for HTTP" (draft-ietf-httpbis-resumable-upload);
// docs/uploads.md has the server's subset.
#include <algorithm>
#include <array>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "client/isomesh/impl.h"
#include "client/isomesh/patience.h"
#include "client/isomesh/transport.h"
#include "proto/json.h"

namespace isomesh {
namespace {

constexpr const char* kPlaces = "/v1/uploads/";

// The digest of the whole body is sent with its beginning, which is empty.
HttpRequest beginning_of(const HttpRequest& upload) {
  HttpRequest request{.method = upload.method, .target = upload.target};
  for (const auto& [name, value] : upload.headers) {
    request.headers.emplace_back(name == "Content-Digest" ? "Repr-Digest" : name, value);
  }
  request.headers.emplace_back("Upload-Complete", "?0");
  request.headers.emplace_back("Upload-Length", std::to_string(upload.source_bytes));
  return request;
}

HttpRequest rest_of(const HttpRequest& upload, const std::string& place, std::uint64_t offset) {
  HttpRequest request{.method = "PATCH", .target = place};
  request.headers = {{"Content-Type", "application/partial-upload"},
                     {"Upload-Complete", "?1"},
                     {"Upload-Offset", std::to_string(offset)}};
  request.source = [&upload, offset](std::uint64_t at, std::span<char> piece) {
    upload.source(offset + at, piece);
  };
  request.source_bytes = upload.source_bytes - offset;
  return request;
}

// Asks for the result of a complete upload.
HttpRequest reading_of(const HttpRequest& upload, const std::string& place) {
  const char* sign = upload.target.find('?') == std::string::npos ? "?" : "&";
  return {.method = upload.method,
          .target = upload.target + sign + "upload=" + place.substr(place.rfind('/') + 1),
          .headers = {{"Content-Type", "application/octet-stream"}}};
}

// True if a retry may help: a proxy does not reach the server, or it still has the broken
// connection. While the server is busy, the transport waits.
bool may_pass(int status) {
  constexpr std::array kPassing = {408, 409, 502, 504};
  return std::ranges::count(kPassing, status) > 0;
}

// True if somebody else has cancelled the upload.
bool is_cancelled(const HttpResponse& response) {
  return response.status == 409 && refusal(response).code() == ErrorCode::kCancelled;
}

// The volumes that were stored before the upload was cancelled.
std::string told_volumes(const std::vector<Volume>& volumes) {
  std::string ids;
  for (const Volume& volume : volumes) ids += (ids.empty() ? "" : ", ") + volume.id;
  if (ids.empty()) return {};
  return std::string("; it was too late to cancel ") +
         (volumes.size() == 1 ? "the volume " : "the volumes ") + ids;
}

struct Progress {
  std::uint64_t offset = 0;
  bool is_whole = false;
};

Progress progress_of(const HttpResponse& response, std::uint64_t bytes) {
  const auto offset = parse_uint64(response.header("upload-offset"));
  if (!offset || *offset > bytes) throw other_api();
  return {*offset, response.header("upload-complete") == "?1"};
}

}  // namespace

std::string Client::Impl::begin_upload(const HttpRequest& request) const {
  try {
    std::string place = repeated(beginning_of(request)).header("location");
    return place.starts_with(kPlaces) ? place : std::string();
  } catch (const Error& error) {
    // Older servers reject an empty body. Other errors recur with the fallback.
    if (error.code() != ErrorCode::kInvalidParameter) throw;
    return {};
  }
}

HttpResponse Client::Impl::resumed(const HttpRequest& request) const {
  const std::string place = begin_upload(request);
  if (place.empty()) return exchange(request);
  try {
    return finish_upload(request, place);
  } catch (const NoResponse&) {
    throw;  // cannot be reported to the server
  } catch (const Error& error) {
    // It has expired, or another daemon answered.
    if (error.code() == ErrorCode::kGone) return exchange(request);
    const std::string left = give_up(place);
    if (left.empty()) throw;
    throw error.with_detail(error.what() + left);
  } catch (...) {
    give_up(place);
    throw;
  }
}

// Cancels the upload, and returns what the user should know about its volumes.
std::string Client::Impl::give_up(const std::string& place) const {
  try {
    const HttpResponse response = parting_.send({.method = "DELETE", .target = place});
    return response.status == 200 ? told_volumes(volumes_from_json(response.body)) : std::string();
  } catch (const Error&) {
    // An incomplete upload expires on the server.
    return "; the server did not confirm that the upload was cancelled";
  }
}

HttpResponse Client::Impl::finish_upload(const HttpRequest& request,
                                         const std::string& place) const {
  std::optional<Progress> known = Progress();
  Patience patience;
  std::exception_ptr failure;
  const auto excuse = [&](std::chrono::milliseconds busy) { patience.excuse(busy); };
  const auto fail = [&](const std::exception_ptr& why) {
    failure = why;
    patience.fail();
    if (!known && patience.is_over()) std::rethrow_exception(why);
    known.reset();
    pause(patience.next_pause());
  };
  while (true) {
    if (known && patience.is_over()) std::rethrow_exception(failure);
    try {
      HttpResponse response =
          transport_.send(!known            ? HttpRequest{.method = "HEAD", .target = place}
                          : known->is_whole ? reading_of(request, place)
                                            : rest_of(request, place, known->offset),
                          excuse);
      // The reason of a conflict is in the body of a GET.
      if (!known && response.status == 409) response = transport_.send({.target = place}, excuse);
      if (is_success(response)) {
        if (known) return response;
        known = progress_of(response, request.source_bytes);
        patience.hear(known->offset);
      } else if (!may_pass(response.status) || is_cancelled(response)) {
        throw refusal(response);
      } else {
        fail(std::make_exception_ptr(refusal(response)));
      }
    } catch (const NoResponse&) {
      fail(std::current_exception());
    }
  }
}

}  // namespace isomesh
