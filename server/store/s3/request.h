// One request to a service that speaks S3, and its answer.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "base/curl.h"
#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/files/files.h"
#include "server/store/s3/address.h"

namespace isomesh::store {

struct S3ClientOptions {
  S3Address address;
  std::filesystem::path credentials;  // a file, read for each request; empty: of the environment
  std::filesystem::path authorities;  // of certificates; empty: those of the system
  std::chrono::milliseconds connect{5'000};
  // A peer that sends or takes less than 1 KiB a second for so long does not answer.
  std::chrono::seconds stall{20};
  // How long a request is repeated for. A transfer that gets on is repeated for as long as it does.
  std::chrono::milliseconds patience{20'000};
  std::chrono::milliseconds first_pause{100};  // before it is repeated; doubles up to 2 s
  std::uint64_t multipart_above = std::uint64_t{64} << 20;
  std::uint64_t part_bytes = std::uint64_t{16} << 20;
};

// Takes the next bytes of an object. What it throws ends the transfer.
using S3Sink = std::function<void(std::span<const std::byte> bytes)>;

// One request, with everything but who sends it and where to.
struct S3Request {
  const char* method = "GET";
  std::string key = {};
  // Of names in their order, each with "=", escaped: as it is signed.
  std::string query = {};
  std::string condition = {};    // a header's line
  std::string_view text = {};    // the body, or
  const File* file = nullptr;    // what it is a part of
  std::uint64_t begin = 0;       // of that part
  std::uint64_t bytes = 0;       // of it
  std::string sha256 = {};       // of the body; empty: of the text
  const S3Sink* sink = nullptr;  // takes the body of an answer 200 or 206
  std::uint64_t sink_begin = 0;  // where the first byte that the sink wants lies in the object
  bool is_quick = false;         // no more than two seconds
  // Over a connection of its own: what fails on one that was used before, libcurl sends again and
  // does not say so.
  bool is_sent_once = false;
};

// Statuses of answers that mean something of their own.
inline constexpr long kS3Ok = 200;
inline constexpr long kS3Partial = 206;
inline constexpr long kS3Forbidden = 403;
inline constexpr long kS3NotFound = 404;
inline constexpr long kS3Conflict = 409;
inline constexpr long kS3PreconditionFailed = 412;
inline constexpr long kS3NotImplemented = 501;

// What came of it.
struct S3Answer {
  long status = 0;                                  // 0: there was none, or it was cut off
  std::map<std::string, std::string> headers = {};  // names in lower case
  std::string text = {};
  std::uint64_t taken = 0;  // bytes that the sink got
  int attempts = 1;

  // Empty without it.
  std::string header(const std::string& name) const;

  // What the peer's clock said; that of this machine where the peer does not tell.
  Time now() const;
};

// Sends requests, over connections that stay open. Thread safe.
class S3Connections {
 public:
  explicit S3Connections(const S3ClientOptions& options) : options_(options) {}

  // Throws what the request's sink throws, Error kCancelled when `stop` is requested, and
  // kUnavailable when the credentials cannot be read.
  S3Answer attempt(const S3Request& request, const std::stop_token& stop) const;

 private:
  curl::Easy take() const;
  void give_back(curl::Easy connection) const;

  const S3ClientOptions options_;
  mutable Mutex mutex_;
  mutable std::vector<curl::Easy> idle_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
