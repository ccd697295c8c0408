#include "server/http/requests/upload.h"

#include <algorithm>
#include <array>
#include <exception>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/hex.h"
#include "base/sha256.h"
#include "server/http/requests/import_query.h"
#include "server/http/requests/partial_upload.h"
#include "server/http/requests/request_values.h"

namespace isomesh::http {
namespace {

// Inflated bodies would need limits of their own.
void check_framing(const Request& request) {
  check_has_length(request);
  const std::string_view encoding = request.header("Content-Encoding");
  if (!encoding.empty() && encoding != "identity") {
    throw Error(ErrorCode::kUnsupportedMedia,
                "Content-Encoding is not supported: send the body without an encoding");
  }
}

Error too_large(std::uint64_t max_bytes) {
  return {ErrorCode::kTooLarge, "the body exceeds " + std::to_string(max_bytes) + " bytes"};
}

void check_length(const Request& request, std::uint64_t max_bytes, std::uint64_t offset = 0) {
  const std::uint64_t left = max_bytes - std::min(offset, max_bytes);
  if (request.content_length.value_or(0) > left) throw too_large(max_bytes);
}

Error other_digest(const std::string& header) {
  return {ErrorCode::kDigestMismatch, "the body's SHA-256 differs from the one in " + header};
}

// The headers that tell the SHA-256 of a whole body, which is a file here.
constexpr std::array kDigestsOfAll = {"Content-Digest", "Repr-Digest"};

Error incomplete(const BodyReader& body, bool is_form) {
  if (body.was_too_slow()) {
    return {ErrorCode::kRequestTimeout, "the body arrived too slowly"};
  }
  if (body.was_malformed()) {
    return invalid_parameter("Transfer-Encoding",
                             "the body is not in chunks, or the fields after it are malformed");
  }
  if (is_form && !body.was_cut()) {
    return {ErrorCode::kInvalidParameter,
            "the body is not a form with the boundary in Content-Type: it must end with "
            "--BOUNDARY-- and a line break"};
  }
  return {ErrorCode::kInvalidParameter, "the body ended before its length"};
}

// Rejects a body before writing any of it if the folder is missing or has not enough free space.
void check_room(const store::DataFolder& folder, const Request& request) {
  folder.check_is_there();
  folder.reserve().check_room();
  if (!request.content_length) return;
  std::error_code error;
  const auto space = std::filesystem::space(folder.scratch(), error);
  if (!error && *request.content_length > space.available) {
    throw Error(ErrorCode::kOutOfSpace, "there is not enough disk space for this upload");
  }
}

// Takes the pieces of a body. Exceptions must not pass through the HTTP library, so they are kept
// and end the reading.
class Receiver {
 public:
  using Write = std::function<void(std::span<const std::byte> piece)>;

  // `offset`: bytes already written.
  Receiver(Write write, store::Reserve& reserve, const UploadLimits& limits,
           const std::atomic<bool>& stopping, bool is_digested, std::uint64_t offset = 0)
      : write_(std::move(write)),
        reserve_(reserve),
        limits_(limits),
        stopping_(stopping),
        is_digested_(is_digested),
        bytes_(offset) {}

  bool take(std::string_view data) {
    try {
      if (stopping_) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
      bytes_ += data.size();
      if (bytes_ > limits_.max_bytes) throw too_large(limits_.max_bytes);
      if (std::chrono::steady_clock::now() > deadline_) {
        throw Error(
            ErrorCode::kRequestTimeout,
            "the upload took longer than " + std::to_string(limits_.max_time.count()) + " seconds");
      }
      held_.append(data);
      if (held_.size() >= kPieceBytes) write_held();
      return true;
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }

  // A form must hold exactly one file.
  bool begin_field(const std::string& name, const std::string& file_name) {
    file_name_ = plain_file_name(file_name);
    if (name != "file" || ++fields_ > 1) {
      failure_ = std::make_exception_ptr(
          invalid_parameter("file", "a form must have exactly one field, `file`"));
      return false;
    }
    return true;
  }

  // Writes the last bytes. Throws the error that ended the reading.
  void finish(const BodyReader& body, bool complete, bool is_form) {
    if (failure_) std::rethrow_exception(failure_);
    if (!complete && stopping_)
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    if (!complete) throw incomplete(body, is_form);
    if (is_form && fields_ == 0) {
      throw invalid_parameter("file", "the form has no field `file`");
    }
    if (bytes_ == 0) throw Error(ErrorCode::kInvalidParameter, "the body is empty");
    write_held();
  }

  // The same for a part; the bytes received so far stay.
  void finish_part(const BodyReader& body, bool complete) {
    if (!failure_) write_held();
    if (failure_ || !complete) finish(body, complete, false);
  }

  const std::string& file_name() const { return file_name_; }
  std::string digest() { return to_hex(digest_.finish()); }

 private:
  static constexpr std::size_t kPieceBytes = std::size_t{256} << 10;

  void write_held() {
    const auto piece = std::as_bytes(std::span(held_));
    reserve_.check_room();
    write_(piece);
    if (is_digested_) digest_.update(piece);
    held_.clear();
  }

  const Write write_;
  store::Reserve& reserve_;
  const UploadLimits& limits_;
  const std::atomic<bool>& stopping_;
  const bool is_digested_;
  std::uint64_t bytes_;
  std::string held_;  // not written yet
  const std::chrono::steady_clock::time_point deadline_ =
      std::chrono::steady_clock::now() + limits_.max_time;
  Sha256 digest_;
  int fields_ = 0;
  std::string file_name_;
  std::exception_ptr failure_;
};

}  // namespace

Upload::Upload(const store::DataFolder& folder, const UploadLimits& limits,
               const std::atomic<bool>& stopping, const Request& request)
    : file_(folder.scratch(), ".upload") {
  check_framing(request);
  check_length(request, limits.max_bytes);
  check_room(folder, request);
  const bool is_form = request.is_form();
  if (is_form && header_parameter(request.header("Content-Type"), "boundary").empty()) {
    throw invalid_parameter("Content-Type", "must have the parameter boundary of the form");
  }
  std::map<std::string, std::string> expected;
  for (const std::string header : kDigestsOfAll) {
    const auto sha256 = sha256_of_digest(request, header);
    if (!sha256) continue;
    if (is_form) {
      throw invalid_parameter(header, "is not supported with a form: send the file without a form");
    }
    expected.emplace(header, *sha256);
  }
  const auto write = [this](std::span<const std::byte> piece) { file_.write(piece); };
  Receiver receiver(write, folder.reserve(), limits, stopping, !expected.empty());
  const auto take = [&](std::string_view piece) { return receiver.take(piece); };
  const bool complete = is_form ? request.body->read_form(
                                      [&](const std::string& name, const std::string& file_name) {
                                        return receiver.begin_field(name, file_name);
                                      },
                                      take)
                                : request.body->read(take);
  receiver.finish(*request.body, complete, is_form);
  const std::string digest = expected.empty() ? "" : receiver.digest();
  for (const auto& [header, sha256] : expected) {
    if (digest != sha256) throw other_digest(header);
  }
  body_ = {file_.path(), is_form ? import::UploadName{receiver.file_name()}
                                 : upload_name_of(request.header("Content-Disposition"))};
}

void receive_part(PartialUpload& upload, const PartialLease& lease, const store::DataFolder& folder,
                  const UploadLimits& limits, const std::atomic<bool>& stopping,
                  const Request& request) {
  check_framing(request);
  check_length(request, limits.max_bytes, lease.offset);
  check_room(folder, request);
  const std::optional<std::string> expected = sha256_of_content_digest(request);
  const auto write = [&](std::span<const std::byte> piece) { upload.write(lease, piece); };
  Receiver receiver(write, folder.reserve(), limits, stopping, expected.has_value(), lease.offset);
  const bool complete =
      request.body->read([&](std::string_view piece) { return receiver.take(piece); });
  receiver.finish_part(*request.body, complete);
  if (expected && receiver.digest() != *expected) {
    upload.take_back(lease);
    throw other_digest("Content-Digest");
  }
}

void check_has_length(const Request& request) {
  if (request.content_length || request.has_body()) return;
  throw Error(ErrorCode::kLengthRequired, "the request needs a Content-Length");
}

std::string read_text(const Request& request, std::size_t max_bytes) {
  check_framing(request);
  check_length(request, max_bytes);
  if (request.is_form()) {
    throw Error(ErrorCode::kUnsupportedMedia, "the body must be JSON, not a form");
  }
  std::string text;
  bool fits = true;
  const bool complete = request.body->read([&](std::string_view piece) {
    fits = text.size() + piece.size() <= max_bytes;
    if (fits) text.append(piece);
    return fits;
  });
  if (!fits) throw too_large(max_bytes);
  if (!complete) throw incomplete(*request.body, false);
  const auto expected = sha256_of_content_digest(request);
  if (expected && sha256_of(text) != *expected) throw other_digest("Content-Digest");
  return text;
}

}  // namespace isomesh::http
