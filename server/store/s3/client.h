// Requests to a service that speaks S3, independent of the purpose of objects.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/file.h"
#include "server/store/s3/request.h"

namespace isomesh::store {

struct S3Object {
  std::string key;  // without the prefix
  std::uint64_t bytes = 0;
  Time modified = {};
};

// Objects with a common prefix of their keys, and the time by the peer's clock.
struct S3Listing {
  std::vector<S3Object> objects;
  Time now;
};

enum class IfThere { kKeep, kReplace };

// Keys have plain characters only and no prefix. Requests are repeated, with growing pauses, while
// the peer does not respond, disconnects or is busy. Throws Error kUnavailable if that continues,
// and for all other rejections and invalid responses: they are never the fault of a job or an
// upload. Throws kOutOfSpace if the peer is full, and kCancelled if `stop` is requested; the
// operation may have taken place nevertheless. The log has the status and the peer's code; messages
// contain neither credentials nor text of the peer. Thread safe.
class S3Client {
 public:
  explicit S3Client(S3ClientOptions options) : options_(std::move(options)) {}

  // True if the bucket can be read. One request without repetition, limited to about two seconds.
  bool responds() const;

  // Stores the first `blob.bytes` bytes of a file; the peer verifies their SHA-256. With kKeep,
  // returns false and replaces nothing if an object of that size exists. Checks afterwards that the
  // object has that size.
  bool put_file(const std::string& key, const File& file, const Blob& blob, IfThere if_there,
                const std::stop_token& stop);

  void put_text(const std::string& key, std::string_view text, const std::stop_token& stop = {});
  std::optional<std::string> get_text(const std::string& key) const;

  // Passes the object's `bytes` bytes to `sink` in order. An interrupted transfer continues where
  // it stopped. Throws Error kNotFound.
  void get(const std::string& key, std::uint64_t bytes, const S3Sink& sink,
           const std::stop_token& stop) const;

  // Size in bytes; empty if the object is missing.
  std::optional<std::uint64_t> size(const std::string& key, const std::stop_token& stop = {}) const;

  enum class Erased { kAtOnce, kMaybeLater };
  // kMaybeLater: the object is gone, but a repeated request may arrive late and erase a new object
  // with the same key.
  Erased erase(const std::string& key);

  // Erases without repetition or error, for objects that do no harm if they stay.
  void try_to_erase(const std::string& key);

  // Lists all objects, with as many requests as necessary.
  S3Listing list(const std::string& beginning, const std::stop_token& stop = {}) const;

  bool has_any(const std::string& beginning) const;

  // See BlobStore::link.
  std::string link(const std::string& key, const LinkedAs& as) const;

 private:
  S3Response ask(const S3Request& request, const std::stop_token& stop = {}) const;
  S3Request listing(const std::string& beginning, const std::string& last, int most) const;
  S3Response put_at_once(const std::string& key, const File& file, const Blob& blob,
                         IfThere if_there, const std::stop_token& stop);
  void put_in_parts(const std::string& key, const File& file, const Blob& blob,
                    const std::stop_token& stop);
  std::string put_part(const std::string& key, const std::string& query, const File& file,
                       std::uint64_t begin, std::uint64_t bytes, const std::stop_token& stop);

  const S3ClientOptions options_;
  const S3Connections connections_{options_};
  mutable std::atomic<bool> knows_conditions_ = true;  // the peer supports If-None-Match
};

}  // namespace isomesh::store
