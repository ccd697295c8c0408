// Resumable uploads: "Resumable Uploads for HTTP" (draft-ietf-httpbis-resumable-upload).
#include "server/http/routes/uploads.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/text.h"
#include "proto/json.h"
#include "server/http/requests/import_query.h"
#include "server/http/requests/request_values.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

const std::string kUploads = "/v1/uploads";
constexpr const char* kComplete = "Upload-Complete";
constexpr const char* kOffset = "Upload-Offset";
constexpr const char* kLength = "Upload-Length";
constexpr const char* kPartType = "application/partial-upload";

[[noreturn]] void throw_no_boolean() { throw invalid_parameter(kComplete, "must be ?0 or ?1"); }

// Structured fields (RFC 9651); empty for anything else.
std::optional<bool> boolean_in(const Request& request, std::string_view header) {
  const std::string_view text = trimmed(request.header(header));
  if (text == "?1") return true;
  if (text == "?0") return false;
  return std::nullopt;
}

// Empty without the header.
std::optional<std::uint64_t> bytes_in(const Request& request, const std::string& header) {
  if (!request.has_header(header)) return std::nullopt;
  const auto number = whole_number(trimmed(request.header(header)));
  if (!number) throw invalid_parameter(header, "must be a number of bytes");
  return number;
}

void tell_limits(const App& app, Response& response) {
  const auto age = std::chrono::duration_cast<std::chrono::seconds>(app.kept.limits().part_time);
  response.set_header("Upload-Limit", "max-size=" + std::to_string(app.options.upload.max_bytes) +
                                          ", max-age=" + std::to_string(age.count()));
}

// Reports the offset, which ends the lease of the present sender.
void tell_state(const App& app, Response& response, PartialUpload& upload) {
  response.set_header(kOffset, std::to_string(upload.end_leases()));
  const PartialNote note = upload.note();
  response.set_header(kComplete, note.is_complete ? "?1" : "?0");
  if (note.length) response.set_header(kLength, std::to_string(*note.length));
  response.set_header("Cache-Control", "no-store");
  tell_limits(app, response);
}

// The problem's type is the draft's, so that any client of the draft understands it.
void answer_other_offset(const App& app, const Request& request, Response& response,
                         PartialUpload& upload) {
  tell_state(app, response, upload);
  response.status = 409;
  response.set_body(
      to_json(Problem{
          .type = "https://iana.org/assignments/http-problem-types#mismatching-upload-offset",
          .title = "Wrong offset",
          .status = response.status,
          .detail = "the upload continues at another offset: see the header Upload-Offset",
          .instance = request.path,
          .errors = {}}),
      "application/problem+json");
}

void check_length(const App& app, std::optional<std::uint64_t> length, Response& response) {
  if (length.value_or(0) <= app.options.upload.max_bytes) return;
  tell_limits(app, response);
  throw Error(ErrorCode::kTooLarge,
              "the upload exceeds " + std::to_string(app.options.upload.max_bytes) + " bytes");
}

// Receives one part of the body, which may be the first and may be empty.
void receive(App& app, const Request& request, PartialUpload& upload, const PartialLease& lease) {
  if (const auto length = bytes_in(request, kLength)) upload.tell_length(lease, *length);
  if (request.content_length && boolean_in(request, kComplete).value_or(false)) {
    upload.tell_length(lease, lease.offset + *request.content_length);
  }
  receive_part(upload, lease, app.services.folder, app.options.upload, app.stopping, request);
}

// An upload with other bytes than announced never becomes complete: it is deleted.
void check_digest(App& app, const Request& request, const PartialUpload& upload) {
  const PartialNote note = upload.note();
  const bool has_all = note.length.value_or(upload.bytes()) == upload.bytes();
  if (note.sha256.empty() || !has_all) return;
  if (store::digest_of(upload.body()->path).key == note.sha256) return;
  app.kept.let_go(owner_of(request), upload.name());
  throw Error(ErrorCode::kDigestMismatch,
              "the upload's SHA-256 differs from the one in Repr-Digest");
}

KeptUploads::Partial upload_of(App& app, const Request& request) {
  check_known(request, {});
  return app.kept.find_partial(owner_of(request), request.path_parameter("id"));
}

void look(App& app, const Request& request, Response& response) {
  tell_state(app, response, *upload_of(app, request));
  response.status = 204;
}

void append(App& app, const Request& request, Response& response) {
  check_has_length(request);
  if (lower(trimmed(split(request.header("Content-Type"), ';').front())) != kPartType) {
    throw Error(ErrorCode::kUnsupportedMedia,
                std::string("the body's Content-Type must be ") + kPartType);
  }
  const auto is_last = boolean_in(request, kComplete);
  if (!is_last) throw_no_boolean();
  const auto offset = bytes_in(request, kOffset);
  if (!offset) throw invalid_parameter(kOffset, "must be a number of bytes");
  check_length(app, bytes_in(request, kLength), response);
  const KeptUploads::Partial upload = upload_of(app, request);
  const auto place = place_for_upload(app, request);
  const std::optional<PartialLease> lease = upload->begin_lease(*offset);
  if (!lease) return answer_other_offset(app, request, response, *upload);
  receive(app, request, *upload, *lease);
  if (!*is_last) {
    tell_state(app, response, *upload);
    response.status = 204;
    return;
  }
  check_digest(app, request, *upload);
  upload->complete(*lease);
  response.set_header(kComplete, "?1");
  Request asked = request;
  asked.query = upload->note().query;
  answer_volumes(app, asked, response, {upload->body(), upload->name(), upload});
}

// A client that cancels its upload may not have received the response with the volume. This
// response names it then.
void cancel(App& app, const Request& request, Response& response) {
  check_known(request, {});
  const std::string owner = owner_of(request);
  std::vector<Volume> stored;
  for (const std::string& id : app.kept.cancel(owner, request.path_parameter("id"))) {
    auto volume = app.services.volumes.find(owner, id);
    if (!volume) continue;  // it was deleted since
    volume->dicom.reset();  // as in lists
    stored.push_back(*std::move(volume));
  }
  response.status = 204;
  if (!stored.empty()) answer_json(response, 200, to_json(stored));
}

}  // namespace

bool begins_upload(const Request& request) {
  const std::optional<bool> is_whole = boolean_in(request, kComplete);
  if (!is_whole && request.has_header(kComplete)) throw_no_boolean();
  return is_whole == false;
}

void check_told_length(const Request& request, std::optional<std::uint64_t> bytes) {
  const std::optional<std::uint64_t> told = bytes_in(request, kLength);
  if (!bytes || !told || *told == *bytes || boolean_in(request, kComplete) != true) return;
  throw invalid_parameter(kLength, "is " + std::to_string(*told) + ", but the body has " +
                                       std::to_string(*bytes) + " bytes");
}

void begin_upload(App& app, const Request& request, Response& response) {
  if (request.has_parameter("upload")) {
    throw invalid_parameter("upload", "names a body that the service already has");
  }
  if (request.is_form()) {
    throw Error(ErrorCode::kUnsupportedMedia,
                "a form cannot be uploaded in parts: send the file without a form");
  }
  const auto length = bytes_in(request, kLength);
  check_length(app, length, response);
  make_room_for(app, length.value_or(0));
  const auto place = place_for_upload(app, request);
  const KeptUploads::Partial upload =
      app.kept.begin({.owner = owner_of(request),
                      .query = request.query,
                      .upload_name = upload_name_of(request.header("Content-Disposition")),
                      .sha256 = sha256_of_digest(request, "Repr-Digest").value_or("")});
  try {
    receive(app, request, *upload, *upload->begin_lease(0));
  } catch (...) {
    // The client does not know its name.
    app.kept.let_go(owner_of(request), upload->name());
    throw;
  }
  tell_state(app, response, *upload);
  response.set_header("Location", kUploads + '/' + upload->name());
  response.status = 201;
}

void add_upload_routes(App& app) {
  const std::string one = kUploads + "/{id}";
  add_get(app, one, [&app](const auto& request, auto& response) { look(app, request, response); });
  add_patch(app, one,
            [&app](const auto& request, auto& response) { append(app, request, response); });
  add_delete(app, one,
             [&app](const auto& request, auto& response) { cancel(app, request, response); });
}

}  // namespace isomesh::http
