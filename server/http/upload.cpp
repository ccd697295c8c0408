#include "server/http/upload.h"

#include <exception>
#include <optional>

#include "server/http/exchange.h"
#include "server/http/request.h"
#include "server/store/files.h"

namespace isomesh::http {
namespace {

// The library would inflate an encoded body past every limit.
void refuse_encoded(const httplib::Request& request) {
  const std::string encoding = request.get_header_value("Content-Encoding");
  if (!encoding.empty() && encoding != "identity") {
    throw Error(ErrorCode::kUnsupportedMedia,
                "Content-Encoding is not supported: send the body as it is");
  }
}

Error too_large(std::uint64_t max_bytes) {
  return {ErrorCode::kTooLarge, "the body exceeds " + std::to_string(max_bytes) + " bytes"};
}

void check_length(const httplib::Request& request, std::uint64_t max_bytes) {
  if (request.has_header("Content-Length") &&
      request.get_header_value<std::uint64_t>("Content-Length") > max_bytes) {
    throw too_large(max_bytes);
  }
}

Error other_digest() {
  return {ErrorCode::kDigestMismatch,
          "the body's SHA-256 is not the one that Content-Digest names"};
}

Error incomplete() {
  const Exchange* exchange = Exchange::current();
  if (exchange != nullptr && exchange->was_too_slow()) {
    return {ErrorCode::kRequestTimeout, "the body came too slowly"};
  }
  return {ErrorCode::kInvalidParameter, "the body ended before its length"};
}

// Before any of it has come, when its length is known: nothing is gained by filling the disk.
void check_room(const store::DataFolder& folder, const httplib::Request& request) {
  if (!request.has_header("Content-Length")) return;
  std::error_code error;
  const auto space = std::filesystem::space(folder.scratch(), error);
  if (!error && request.get_header_value<std::uint64_t>("Content-Length") > space.available) {
    throw Error(ErrorCode::kOutOfSpace, "there is no room for this upload");
  }
}

// Receives the pieces of a body. An exception must not cross the library, so it is kept and the
// reading ended.
class Receiver {
 public:
  Receiver(store::File& file, const UploadLimits& limits, const std::atomic<bool>& stopping)
      : file_(file), limits_(limits), stopping_(stopping) {}

  bool take(const char* data, std::size_t size) {
    try {
      if (stopping_) throw Error(ErrorCode::kUnavailable, "the service is shutting down");
      bytes_ += size;
      if (bytes_ > limits_.max_bytes) throw too_large(limits_.max_bytes);
      if (std::chrono::steady_clock::now() > deadline_) {
        throw Error(
            ErrorCode::kRequestTimeout,
            "the upload took longer than " + std::to_string(limits_.max_time.count()) + " seconds");
      }
      const auto piece = std::as_bytes(std::span(data, size));
      file_.write(piece);
      digest_.update(piece);
      return true;
    } catch (...) {
      failure_ = std::current_exception();
      return false;
    }
  }

  // A form may hold one file and nothing else.
  bool begin_part(const httplib::MultipartFormData& part) {
    if (part.name != "file" || ++parts_ > 1) {
      failure_ = std::make_exception_ptr(
          invalid_parameter("file", "a form must have the one field `file`"));
      return false;
    }
    return true;
  }

  // Throws what ended the reading.
  void check(bool complete, bool is_form) const {
    if (failure_) std::rethrow_exception(failure_);
    if (!complete && stopping_)
      throw Error(ErrorCode::kUnavailable, "the service is shutting down");
    if (!complete) throw incomplete();
    if (is_form && parts_ == 0) {
      throw invalid_parameter("file", "the form has no field `file`");
    }
    if (bytes_ == 0) throw Error(ErrorCode::kInvalidParameter, "the body is empty");
  }

  std::string digest() { return store::to_hex(digest_.finish()); }

 private:
  store::File& file_;
  const UploadLimits& limits_;
  const std::atomic<bool>& stopping_;
  const std::chrono::steady_clock::time_point deadline_ =
      std::chrono::steady_clock::now() + limits_.max_time;
  store::Sha256 digest_;
  std::uint64_t bytes_ = 0;
  int parts_ = 0;
  std::exception_ptr failure_;
};

}  // namespace

Upload::Upload(const store::DataFolder& folder, const UploadLimits& limits,
               const std::atomic<bool>& stopping, const httplib::Request& request,
               const httplib::ContentReader& read_body)
    : scratch_(folder.scratch()), path_(scratch_.path() / "upload") {
  refuse_encoded(request);
  check_length(request, limits.max_bytes);
  check_room(folder, request);
  const std::optional<std::string> expected = sha256_of_content_digest(request);
  const bool is_form = request.is_multipart_form_data();
  if (is_form && expected) {
    throw invalid_parameter("Content-Digest", "is not supported with a form: send the bare file");
  }
  store::File file = store::File::create(path_);
  Receiver receiver(file, limits, stopping);
  const auto take = [&](const char* data, std::size_t size) { return receiver.take(data, size); };
  const bool complete =
      is_form
          ? read_body(
                [&](const httplib::MultipartFormData& part) { return receiver.begin_part(part); },
                take)
          : read_body(take);
  receiver.check(complete, is_form);
  if (expected && receiver.digest() != *expected) throw other_digest();
}

std::string read_text(const httplib::Request& request, const httplib::ContentReader& read_body,
                      std::size_t max_bytes) {
  refuse_encoded(request);
  check_length(request, max_bytes);
  if (request.is_multipart_form_data()) {
    throw Error(ErrorCode::kUnsupportedMedia, "the body must be JSON, not a form");
  }
  std::string text;
  bool fits = true;
  const bool complete = read_body([&](const char* data, std::size_t size) {
    fits = text.size() + size <= max_bytes;
    if (fits) text.append(data, size);
    return fits;
  });
  if (!fits) throw too_large(max_bytes);
  if (!complete) throw incomplete();
  const auto expected = sha256_of_content_digest(request);
  if (expected && store::sha256_of(text) != *expected) throw other_digest();
  return text;
}

}  // namespace isomesh::http
