#include "server/store/s3/client.h"

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "base/clock.h"
#include "base/hex.h"
#include "base/ids.h"
#include "base/log.h"
#include "base/sha256.h"
#include "base/text.h"
#include "base/xml_reader.h"
#include "proto/error.h"
#include "server/store/s3/address.h"

namespace isomesh::store {
namespace {

// The root element of a response in XML, and all elements that contain only text.
struct S3Text {
  struct Leaf {
    std::string parent;
    std::string name;
    std::string text;
  };

  std::string root;
  std::vector<Leaf> leaves;

  // The text of the first element with that name, at any depth; empty if there is none.
  std::string_view find(std::string_view name) const {
    const auto found = std::ranges::find(leaves, name, &Leaf::name);
    return found == leaves.end() ? std::string_view() : found->text;
  }
};

class Leaves : public XmlHandler {
 public:
  explicit Leaves(S3Text& target) : target_(target) {}

  void start_element(std::string_view name, const XmlAttributes& /*attributes*/) override {
    if (path_.empty()) target_.root = name;
    path_.emplace_back(name);
    text_.clear();
    is_leaf_ = true;
  }

  void end_element(std::string_view /*name*/) override {
    std::string name = std::move(path_.back());
    path_.pop_back();
    if (is_leaf_) {
      target_.leaves.push_back({path_.empty() ? "" : path_.back(), std::move(name), text_});
    }
    is_leaf_ = false;
  }

  void text(std::string_view part) override { text_ += part; }

 private:
  S3Text& target_;
  std::vector<std::string> path_;
  std::string text_;
  bool is_leaf_ = false;
};

// Empty if the body is not XML or is truncated.
S3Text read_s3_text(std::string_view body) {
  S3Text text;
  try {
    Leaves leaves(text);
    XmlReader(leaves).read(body, true);
  } catch (const XmlError&) {
    return {};
  }
  return text;
}

// The text of a page of a list.
S3Text listing_in(const S3Response& response) {
  S3Text text = read_s3_text(response.text);
  if (response.status == kS3Ok && text.root == "ListBucketResult") return text;
  throw Error(ErrorCode::kUnavailable, "the storage of volumes and meshes cannot be listed");
}

// Safe for a log; empty if there is none.
std::string s3_error_code(std::string_view body) {
  const S3Text text = read_s3_text(body);
  constexpr std::size_t kLongest = 60;
  return text.root == "Error" ? printable(beginning(text.find("Code"), kLongest)) : "";
}

using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kLongestPause{2};
constexpr int kListedAtOnce = 1000;
constexpr int kMostPages = 100'000;
// S3 allows 10 000.
constexpr std::uint64_t kMostParts = 9'000;

bool is_out_of_space(long status, std::string_view code) {
  constexpr std::array<std::string_view, 3> kCodes = {"XMinioStorageFull", "QuotaExceeded",
                                                      "XMinioAdminBucketQuotaExceeded"};
  return status == kS3InsufficientStorage || std::ranges::find(kCodes, code) != kCodes.end();
}

// Throws for a response that no request should get: it is the storage's fault, not the job's.
[[noreturn]] void reject(const S3Response& response) {
  const std::string code = s3_error_code(response.text);
  if (response.status == 0 || response.status / 100 == 2) {  // silent, or it sends too little
    log_error("the storage does not respond");
    throw Error(ErrorCode::kUnavailable,
                "the storage of volumes and meshes does not respond; nothing is lost");
  }
  log_error("the storage rejected a request with status {} {}", response.status, code);
  if (is_out_of_space(response.status, code)) {
    throw Error(ErrorCode::kOutOfSpace, "the storage of volumes and meshes has no space left");
  }
  if (response.status == kS3Forbidden) {
    throw Error(ErrorCode::kUnavailable,
                "the storage of volumes and meshes denies access to this service; nothing is lost");
  }
  throw Error(ErrorCode::kUnavailable,
              "the storage of volumes and meshes rejects requests; nothing is lost");
}

// Pauses between repeated requests; each is twice as long as the one before.
class Pauses {
 public:
  Pauses(std::chrono::milliseconds first, std::chrono::milliseconds patience)
      : first_(first), patience_(patience) {
    start_over();
  }

  void start_over() {
    next_ = first_;
    end_ = Clock::now() + patience_;
  }

  // Throws if the time is over, because of the last `response`, or if `stop` is requested.
  void wait(const S3Response& response, const std::stop_token& stop) {
    if (Clock::now() + next_ > end_) reject(response);
    const auto until = Clock::now() + next_;
    constexpr std::chrono::milliseconds kLook{20};
    while (Clock::now() < until) {
      if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
      std::this_thread::sleep_for(std::min<Clock::duration>(kLook, until - Clock::now()));
    }
    next_ = std::min<std::chrono::milliseconds>(next_ * 2, kLongestPause);
  }

 private:
  const std::chrono::milliseconds first_;
  const std::chrono::milliseconds patience_;
  std::chrono::milliseconds next_{0};
  Clock::time_point end_;
};

// Credentials are read again for each attempt, so a token that has expired may have been replaced.
bool is_worth_repeating(const S3Response& response) {
  constexpr std::array kPassing = {0L, 408L, kS3Conflict, 429L, 500L, 502L, 503L, 504L};
  if (std::ranges::find(kPassing, response.status) != kPassing.end()) return true;
  if (response.status != kS3BadRequest) return false;
  const std::string code = s3_error_code(response.text);
  return code == "RequestTimeout" || code == "ExpiredToken";
}

// Conditions are not supported by every peer.
bool is_answer(const S3Request& request, long status) {
  if (status / 100 == 2 || status == kS3NotFound) return true;
  const bool is_about_condition = status == kS3PreconditionFailed || status == kS3NotImplemented;
  return is_about_condition && !request.condition.empty();
}

}  // namespace

S3Response S3Client::ask(const S3Request& request, const std::stop_token& stop) const {
  Pauses pauses(options_.first_pause, options_.patience);
  for (int attempts = 1;; ++attempts) {
    S3Response response = connections_.attempt(request, stop);
    response.attempts = attempts;
    if (is_worth_repeating(response)) {
      pauses.wait(response, stop);
      continue;
    }
    if (!is_answer(request, response.status)) reject(response);
    return response;
  }
}

bool S3Client::responds() const {
  S3Request request = listing("", "", 1);
  request.is_quick = true;
  try {
    return connections_.attempt(request, {}).status == kS3Ok;
  } catch (const Error&) {
    return false;
  }
}

std::optional<std::uint64_t> S3Client::size(const std::string& key,
                                            const std::stop_token& stop) const {
  const S3Response response = ask({.method = "HEAD", .key = key}, stop);
  if (response.status == kS3NotFound) return std::nullopt;
  const auto bytes = parse_uint64(response.header("content-length"));
  if (response.status != kS3Ok || !bytes) {
    throw Error(ErrorCode::kUnavailable,
                "the storage of volumes and meshes does not give the size of a file");
  }
  return bytes;
}

bool S3Client::put_file(const std::string& key, const File& file, const Blob& blob,
                        IfThere if_there, const std::stop_token& stop) {
  constexpr int kTries = 3;
  for (int n = 0; n < kTries; ++n) {
    bool is_stored = true;
    if (blob.bytes > options_.multipart_above) {
      const auto there = if_there == IfThere::kKeep ? size(key, stop) : std::nullopt;
      is_stored = there != blob.bytes;
      if (is_stored) put_in_parts(key, file, blob, stop);
    } else {
      const S3Response response = put_at_once(key, file, blob, if_there, stop);
      if (response.status == kS3NotFound) reject(response);  // the bucket is missing
      is_stored = response.status / 100 == 2;
    }
    // A successful PUT does not prove that the object is stored.
    if (size(key, stop) == blob.bytes) return is_stored;
    if_there = IfThere::kReplace;
  }
  throw Error(ErrorCode::kUnavailable,
              "the storage of volumes and meshes does not keep what is sent to it");
}

S3Response S3Client::put_at_once(const std::string& key, const File& file, const Blob& blob,
                                 IfThere if_there, const std::stop_token& stop) {
  S3Request request = {
      .method = "PUT", .key = key, .file = &file, .bytes = blob.bytes, .sha256 = blob.key};
  if (if_there == IfThere::kKeep && knows_conditions_) {
    request.condition = "If-None-Match: *";
    S3Response response = ask(request, stop);
    if (response.status != kS3NotImplemented) return response;
    knows_conditions_ = false;
    request.condition.clear();
  }
  return ask(request, stop);
}

void S3Client::put_in_parts(const std::string& key, const File& file, const Blob& blob,
                            const std::stop_token& stop) {
  const S3Response begun = ask({.method = "POST", .key = key, .query = "uploads="}, stop);
  const S3Text text = read_s3_text(begun.text);
  const std::string id(text.find("UploadId"));
  if (begun.status != kS3Ok) reject(begun);
  if (id.empty()) {
    throw Error(ErrorCode::kUnavailable,
                "the storage of volumes and meshes does not accept multipart uploads");
  }
  const std::string upload = "uploadId=" + percent_encode(id);
  try {
    const std::uint64_t part_bytes = std::max(options_.part_bytes, blob.bytes / kMostParts + 1);
    std::string parts;
    int number = 0;
    for (std::uint64_t begin = 0; begin < blob.bytes; begin += part_bytes) {
      const std::string part = std::to_string(++number);
      const std::string tag = put_part(key, "partNumber=" + part + '&' + upload, file, begin,
                                       std::min(part_bytes, blob.bytes - begin), stop);
      parts += "<Part><PartNumber>" + part + "</PartNumber><ETag>" + tag + "</ETag></Part>";
    }
    const std::string whole =
        "<CompleteMultipartUpload xmlns=\"http://s3.amazonaws.com/doc/2006-03-01/\">" + parts +
        "</CompleteMultipartUpload>";
    // The status may be sent before the outcome is known, and a repeated request may find that the
    // upload no longer exists. The object's size then decides.
    const S3Response ended =
        ask({.method = "POST", .key = key, .query = upload, .text = whole}, stop);
    if (ended.status == kS3Ok && read_s3_text(ended.text).root == "CompleteMultipartUploadResult") {
      return;
    }
  } catch (...) {
    try {
      connections_.attempt({.method = "DELETE", .key = key, .query = upload, .is_quick = true}, {});
    } catch (const Error&) {
      log_debug("an incomplete multipart upload is left to the storage's own rules");
    }
    throw;
  }
}

std::string S3Client::put_part(const std::string& key, const std::string& query, const File& file,
                               std::uint64_t begin, std::uint64_t bytes,
                               const std::stop_token& stop) {
  Sha256 digest;
  const auto add = [&](std::span<const std::byte> block) { digest.update(block); };
  if (file.read(add, begin, bytes) < bytes) {
    throw Error(ErrorCode::kInternal, "a file became shorter while it was stored");
  }
  const S3Response response = ask({.method = "PUT",
                                   .key = key,
                                   .query = query,
                                   .file = &file,
                                   .begin = begin,
                                   .bytes = bytes,
                                   .sha256 = to_hex(digest.finish())},
                                  stop);
  const std::string tag = response.header("etag");
  if (response.status != kS3Ok || tag.empty() || tag.find_first_of("<>&") != tag.npos) {
    throw Error(ErrorCode::kUnavailable, "the storage of volumes and meshes has lost an upload");
  }
  return tag;
}

void S3Client::put_text(const std::string& key, std::string_view text,
                        const std::stop_token& stop) {
  const S3Response response = ask({.method = "PUT", .key = key, .text = text}, stop);
  if (response.status == kS3NotFound) reject(response);  // the bucket is missing
}

std::optional<std::string> S3Client::get_text(const std::string& key) const {
  S3Response response = ask({.key = key});
  if (response.status == kS3NotFound) return std::nullopt;
  return std::move(response.text);
}

void S3Client::get(const std::string& key, std::uint64_t bytes, const S3Sink& sink,
                   const std::stop_token& stop) const {
  Pauses pauses(options_.first_pause, options_.patience);
  std::uint64_t done = 0;
  while (done < bytes) {
    S3Request request = {.key = key, .bytes = bytes - done, .sink = &sink, .sink_begin = done};
    if (done > 0) request.condition = "Range: bytes=" + std::to_string(done) + '-';
    const S3Response response = connections_.attempt(request, stop);
    done += response.taken;
    if (response.status == kS3NotFound) {
      if (!responds()) reject(response);  // a missing bucket also looks like a missing object
      throw Error(ErrorCode::kNotFound, "the file does not exist");
    }
    if (done == bytes) return;
    if (response.status == kS3Forbidden) reject(response);
    if (response.taken > 0) pauses.start_over();
    pauses.wait(response, stop);
  }
}

S3Client::Erased S3Client::erase(const std::string& key) {
  const auto asked = ask({.method = "DELETE", .key = key, .is_sent_once = true});
  return asked.attempts == 1 ? Erased::kAtOnce : Erased::kMaybeLater;
}

void S3Client::try_to_erase(const std::string& key) {
  try {
    connections_.attempt({.method = "DELETE", .key = key, .is_quick = true}, {});
  } catch (const Error& error) {
    log_debug("an object could not be erased and is left in the storage: {}", error.what());
  }
}

// Continues by the last key of the previous page, not by its token: tokens may contain "+", which
// libcurl 8.14 signs as a space.
S3Request S3Client::listing(const std::string& beginning, const std::string& last, int most) const {
  std::string query = "list-type=2&max-keys=" + std::to_string(most) +
                      "&prefix=" + percent_encode(options_.address.prefix + beginning);
  if (!last.empty()) query += "&start-after=" + percent_encode(options_.address.prefix + last);
  return {.query = std::move(query)};
}

S3Listing S3Client::list(const std::string& beginning, const std::stop_token& stop) const {
  S3Listing all;
  std::string last;
  for (int page = 0; page < kMostPages; ++page) {
    const S3Response response = ask(listing(beginning, last, kListedAtOnce), stop);
    const S3Text text = listing_in(response);
    all.now = response.now();
    for (const auto& [parent, name, value] : text.leaves) {
      if (parent != "Contents") continue;
      if (name == "Key") {
        // If the peer lists other objects than requested, they must not be swept.
        if (!value.starts_with(options_.address.prefix + beginning)) {
          throw Error(ErrorCode::kUnavailable, "the storage lists objects that were not requested");
        }
        all.objects.push_back({.key = value.substr(options_.address.prefix.size())});
      }
      if (all.objects.empty()) continue;
      if (name == "LastModified") all.objects.back().modified = time_of(value);
      if (name == "Size") all.objects.back().bytes = parse_uint64(value).value_or(0);
    }
    if (text.find("IsTruncated") != "true") return all;
    if (all.objects.empty() || all.objects.back().key == last) break;
    last = all.objects.back().key;
  }
  throw Error(ErrorCode::kUnavailable, "a list of the storage does not end");
}

bool S3Client::has_any(const std::string& beginning) const {
  return !listing_in(ask(listing(beginning, "", 1))).find("Key").empty();
}

std::string S3Client::link(const std::string& key, const LinkedAs& as) const {
  return presigned_url(options_.address, read_s3_credentials(options_.credentials),
                       options_.address.prefix + key, as, std::chrono::system_clock::now());
}

}  // namespace isomesh::store
