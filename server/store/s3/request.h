// One request to a service that speaks S3, and its response.
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
#include "server/store/file.h"
#include "server/store/s3/address.h"

namespace isomesh::store {

struct S3ClientOptions {
  S3Address address;
  std::filesystem::path credentials;  // a file, read for each request; empty: from the environment
  std::filesystem::path authorities;  // a file of certificates; empty: those of the system
  std::chrono::milliseconds connect{5'000};
  // A peer that transfers less than 1 KiB per second for this long counts as unresponsive.
  std::chrono::seconds stall{20};
  // A request is repeated for this long; a transfer that advances is repeated for longer.
  std::chrono::milliseconds patience{20'000};
  std::chrono::milliseconds first_pause{100};  // before the first repetition; doubles up to 2 s
  // Limit for requests that others wait for, or that may fail: a sign of life, or erasing.
  std::chrono::milliseconds quick{2'000};
  std::uint64_t multipart_above = std::uint64_t{64} << 20;
  std::uint64_t part_bytes = std::uint64_t{16} << 20;
};

// Receives the next bytes of an object. An exception aborts the transfer.
using S3Sink = std::function<void(std::span<const std::byte> bytes)>;

// A request without its sender and its address.
struct S3Request {
  const char* method = "GET";
  std::string key = {};
  // Names in ascending order, each with "=", escaped: the form that is signed.
  std::string query = {};
  std::string condition = {};    // a header line
  std::string_view text = {};    // the body, or
  const File* file = nullptr;    // a file with the body
  std::uint64_t begin = 0;       // where the body begins in the file
  std::uint64_t bytes = 0;       // size of the body
  std::string sha256 = {};       // of the body; empty: computed from the text
  const S3Sink* sink = nullptr;  // receives the body of a response 200 or 206
  std::uint64_t sink_begin = 0;  // offset in the object of the sink's first byte
  bool is_quick = false;         // limited to S3ClientOptions::quick
  // Uses a new connection: libcurl silently repeats requests that fail on a reused one.
  bool is_sent_once = false;
};

// Statuses with a specific meaning.
inline constexpr long kS3Ok = 200;
inline constexpr long kS3Partial = 206;
inline constexpr long kS3BadRequest = 400;
inline constexpr long kS3Forbidden = 403;
inline constexpr long kS3NotFound = 404;
inline constexpr long kS3Conflict = 409;
inline constexpr long kS3PreconditionFailed = 412;
inline constexpr long kS3NotImplemented = 501;
inline constexpr long kS3InsufficientStorage = 507;

struct S3Response {
  long status = 0;                                  // 0: none, or the transfer was aborted
  std::map<std::string, std::string> headers = {};  // names in lower case
  std::string text = {};
  std::uint64_t taken = 0;  // bytes passed to the sink
  int attempts = 1;

  // Empty if the header is missing.
  std::string header(const std::string& name) const;

  // The time by the peer's clock; by this machine's if the response has none.
  Time now() const;
};

// Sends requests over persistent connections. Thread safe.
class S3Connections {
 public:
  explicit S3Connections(const S3ClientOptions& options) : options_(options) {}

  // Throws what the request's sink throws; Error kCancelled if `stop` is requested; kUnavailable if
  // the credentials cannot be read.
  S3Response attempt(const S3Request& request, const std::stop_token& stop) const;

 private:
  curl::Easy take() const;
  void give_back(curl::Easy connection) const;

  const S3ClientOptions options_;
  mutable Mutex mutex_;
  mutable std::vector<curl::Easy> idle_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
