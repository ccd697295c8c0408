// Requests to a service that speaks S3. What objects are for is not known here.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/files/files.h"
#include "server/store/s3/request.h"

namespace isomesh::store {

// What a list tells of an object.
struct S3Object {
  std::string key;  // without the prefix
  std::uint64_t bytes = 0;
  Time modified = {};
};

// Objects whose keys begin alike, and what the peer's clock said then.
struct S3Listing {
  std::vector<S3Object> objects;
  Time now;
};

enum class IfThere { kKeep, kReplace };

// Keys are of plain characters and without the prefix. Everything is repeated, with pauses that
// grow, while the peer does not answer, breaks off or says that it is busy, and throws Error
// kUnavailable when that goes on, or when the peer refuses; kInternal for answers that make no
// sense. Neither credentials nor what a peer writes gets into a message. Thread safe.
class S3Client {
 public:
  explicit S3Client(S3ClientOptions options) : options_(std::move(options)) {}

  // One request that is not repeated, within about two seconds: whether the bucket can be read.
  bool answers() const;

  // Stores so many bytes from the beginning of a file, of that digest (hex SHA-256), which the peer
  // checks. With kKeep false, and nothing is replaced, where an object of that size is there
  // already. Afterwards the peer says that it has an object of that size.
  bool put_file(const std::string& key, const File& file, const Blob& blob, IfThere if_there) const;

  void put_text(const std::string& key, std::string_view text) const;
  std::optional<std::string> get_text(const std::string& key) const;

  // Passes on all of an object that has so many bytes, in order. A transfer that is cut off goes on
  // where it was. Throws Error kNotFound, and kCancelled when `stop` is requested.
  void get(const std::string& key, std::uint64_t bytes, const S3Sink& sink,
           const std::stop_token& stop) const;

  // In bytes; empty when it is not there.
  std::optional<std::uint64_t> size(const std::string& key) const;

  enum class Erased { kAtOnce, kMaybeLater };
  // kMaybeLater: it is gone, but a request that was repeated may be late, and erase what is there
  // then.
  Erased erase(const std::string& key) const;

  // Tried once: for what does no harm where it stays.
  void try_to_erase(const std::string& key) const;

  // All of them, however many requests that takes.
  S3Listing list(const std::string& beginning) const;

  // Whether there is one at all.
  bool has_any(const std::string& beginning) const;

  // See BlobStore::link.
  std::string link(const std::string& key, const LinkedAs& as) const;

 private:
  S3Answer ask(const S3Request& request, const std::stop_token& stop = {}) const;
  S3Request listing(const std::string& beginning, const std::string& last, int most) const;
  S3Answer put_at_once(const std::string& key, const File& file, const Blob& blob,
                       IfThere if_there) const;
  void put_in_parts(const std::string& key, const File& file, const Blob& blob) const;
  std::string put_part(const std::string& key, const std::string& query, const File& file,
                       std::uint64_t begin, std::uint64_t bytes) const;

  const S3ClientOptions options_;
  const S3Connections connections_{options_};
  mutable std::atomic<bool> knows_conditions_ = true;  // the peer has If-None-Match
};

}  // namespace isomesh::store
