// Interface of the store of finished files (blobs), which are named by the SHA-256 of their bytes.
//
// Every engine also needs a local disk. A blob is first written there, because its name is known
// only at its end. And the sandboxed processes `isomesh-job` and `isomesh-import` map or open blobs
// only as local files (LocalBlob), whose bytes were verified.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "server/store/expiry.h"
#include "server/store/file.h"
#include "server/store/room.h"

namespace isomesh::store {

struct Blob {
  std::string key;  // SHA-256 in hex
  std::uint64_t bytes = 0;
};

// Reads a file, and starts writing it to the disk meanwhile. Throws Error kOutOfSpace or kInternal.
Blob digest_of(const std::filesystem::path& file);

// Receives the bytes of a blob in order. Uncommitted bytes are removed on destruction. Not thread
// safe.
class BlobWriter {
 public:
  virtual ~BlobWriter() = default;

  // Throws Error kOutOfSpace; kTooLarge if the blob exceeds all available space.
  virtual void write(std::span<const std::byte> bytes) = 0;

  // Makes the bytes a blob that survives a crash. Call once. Throws Error kOutOfSpace; kUnavailable
  // if a remote store does not respond; kCancelled if `stop` is requested while it sends the bytes.
  Blob commit(const std::stop_token& stop = {}) { return store(stop); }

 private:
  virtual Blob store(const std::stop_token& stop) = 0;
};

// An open blob. Stays readable after the blob is erased.
using BlobReader = File;

// A blob as a local file, to be mapped. The file exists while this object does: a remote store
// keeps its local copy until `held` is released.
struct LocalBlob {
  std::filesystem::path path;
  std::shared_ptr<const void> held = {};
};

// Headers of the response to whoever follows a link to a blob.
struct LinkedAs {
  std::string name;  // for saving; no control characters, quotes or backslashes
  std::string media_type;
  std::chrono::seconds lasts{60};
};

struct Swept {
  std::size_t quarantined = 0;
  std::size_t left = 0;  // further unnamed blobs, beyond the limit of one sweep
};

// Returns true if a record names the blob with that key.
using Names = std::function<bool(const std::string& key)>;
using Steady = std::chrono::steady_clock::time_point;

// Blobs appear atomically and never change. Several daemons may share a store: no daemon erases or
// sweeps what another one has stored and is about to name. Thread safe. All methods throw Error
// kUnavailable if a remote store does not respond for a while, or a folder is missing; the
// operation may have taken place nevertheless.
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  // Limits the total size of all blobs to `max_bytes` (0: no limit but the disk), and sets the
  // function that frees space. Call before anything is stored.
  void limit_room(std::uint64_t max_bytes, MakeRoom make) {
    room_.limit(max_bytes, std::move(make));
  }

  // True if the store responds. Fast, so it can be called often.
  virtual bool responds() const = 0;

  // True if other daemons may use the store too.
  virtual bool is_shared() const = 0;

  virtual bool is_empty() const = 0;

  // A short text stored with the blobs that names the database they belong to (see Identity); empty
  // if there is none.
  virtual std::string mark() const = 0;
  virtual void set_mark(const std::string& text) = 0;

  // `owner`: whose data the blob will be, for sharing limited space between owners. Its bytes count
  // as his until the writer is destroyed, and then as those of the records that name the blob.
  virtual std::unique_ptr<BlobWriter> begin(const std::string& owner) = 0;

  // False if space is so short that no new work should start.
  virtual bool has_room() const = 0;

  // Total size of all blobs, including those in quarantine and those being written. Blobs stored by
  // other daemons are included as of the last sweep().
  std::uint64_t bytes() const { return room_.used(); }

  // The size that all blobs may reach if nothing else is stored, by the limit and the local disk on
  // which they are written.
  std::uint64_t capacity() const { return room_.capacity(disk_capacity()); }

  // Turns a finished local file into a blob that survives a crash, and removes the file. `blob` is
  // the recent result of digest_of(file), so that is_intact() need not read it again. `owner`: as
  // for begin(). `stop`: as for commit(). Throws Error kOutOfSpace, kCancelled.
  virtual void adopt(const std::filesystem::path& file, const Blob& blob, const std::string& owner,
                     const std::stop_token& stop) = 0;

  // Opens a local copy: a remote blob is first fetched and verified. Throws Error kNotFound;
  // kInternal if its bytes do not match the key.
  virtual std::unique_ptr<BlobReader> open(const std::string& key) const = 0;

  // Throws as open() does.
  virtual LocalBlob local(const std::string& key) const = 0;

  // True if the blob's bytes match its key. A blob that was recently read and found intact is not
  // read again unless its file was touched; concurrent callers share one read. Throws Error
  // kNotFound; kCancelled if `stop` is requested meanwhile.
  virtual bool is_intact(const std::string& key, const std::stop_token& stop) const = 0;

  // Size in bytes; empty if the blob is missing.
  virtual std::optional<std::uint64_t> size(const std::string& key) const = 0;

  // A URL at which anybody can fetch the bytes for a while, directly from the remote store; empty
  // if the store has no such URLs. Does not check that the blob exists.
  virtual std::optional<std::string> link(const std::string& key, const LinkedAs& as) const = 0;

  // Postpones the slow part of erasing a large blob (the disk frees its bytes) until the result is
  // released. Null if there is no such part.
  virtual std::shared_ptr<const void> hold_bytes(const std::string& key) const = 0;

  // Erases a blob; the caller must know that nobody is about to name it. Does nothing if it is
  // missing. Open readers stay valid.
  virtual void erase(const std::string& key) = 0;

  // Tells the store that a record names the blob now. Call once for each time the blob was stored.
  virtual void mark_named(const std::string& key) = 0;

  // Erases the given blobs, except those that `names` reports, and those that any daemon has stored
  // since `spare_since` and not marked as named. Returns the latter.
  virtual std::vector<std::string> erase_unnamed(std::span<const std::string> keys,
                                                 Steady spare_since, const Names& names) = 0;

  // Moves unnamed blobs into quarantine, with the same exceptions. One sweep moves only a fraction
  // of all blobs: if the records name almost none, the records are more likely wrong. Reading a
  // quarantined blob brings it back. Engines for which sweeping is expensive do it only now and
  // then.
  virtual Swept sweep(Steady spare_since, const Names& names) = 0;

  // Removes blobs that have been in quarantine since before that time and are still unnamed.
  // Returns their number.
  virtual std::size_t empty_quarantine(Time before, const Names& names) = 0;

 protected:
  Room room_;

 private:
  // Size of the disk that has the blobs, or on which they are written.
  virtual std::uint64_t disk_capacity() const = 0;
};

// The most blobs that one sweep moves into quarantine, out of so many: a tenth, but always a few.
inline std::size_t most_swept(std::size_t blobs) { return std::max<std::size_t>(16, blobs / 10); }

// As is_intact, but returns false if the blob is missing.
bool is_there_and_intact(const BlobStore& blobs, const std::string& key,
                         const std::stop_token& stop);

}  // namespace isomesh::store
