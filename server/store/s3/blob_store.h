#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/health_check.h"
#include "server/store/keyed_turns.h"
#include "server/store/s3/blob_cache.h"
#include "server/store/s3/client.h"
#include "server/store/unnamed_blobs.h"

namespace isomesh::store {

struct S3Options {
  S3ClientOptions client;
  std::uint64_t cache_bytes = std::uint64_t{8} << 30;
  // A sweep lists the whole bucket.
  std::chrono::milliseconds between_sweeps = std::chrono::minutes(10);
};

// Blobs as objects in a bucket that several daemons share, with a local cache of copies. Objects
// below the prefix:
//
//   blobs/KEY            the bytes
//   quarantine/KEY       empty: the blob is unnamed since this object was made; it stays in place
//   holds/KEY/RANDOM     empty: a daemon stores the blob, or has stored and not named it yet
//   going/KEY/RANDOM     empty: a daemon is about to erase the blob
//   identity             mark()
//
// To store a blob, a daemon first makes a hold, and then waits until no daemon is about to erase
// the blob. To erase one, it first announces that, and then checks for holds and names. S3 lists
// new objects at once, so the second of two daemons sees the first, and a blob stored under a hold
// is never erased. Objects left by dead daemons expire by the peer's clock; the clocks of nodes do
// not matter.
class S3BlobStore : public BlobStore {
 public:
  // `folder` must outlive this object. Sends no request yet.
  S3BlobStore(const DataFolder& folder, S3Options options);

  bool responds() const override;
  bool is_shared() const override { return true; }
  bool is_empty() const override;
  std::string mark() const override;
  void set_mark(const std::string& text) override;
  std::unique_ptr<BlobWriter> begin(const std::string& owner) override;
  // About the local disk; removes copies first if it is full.
  bool has_room() const override;
  void adopt(const std::filesystem::path& file, const Blob& blob, const std::string& owner,
             const std::stop_token& stop) override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override;
  LocalBlob local(const std::string& key) const override;
  // Checks the local copy as FileBlobStore does; fetches one if there is none.
  bool is_intact(const std::string& key, const std::stop_token& stop) const override;
  std::optional<std::uint64_t> size(const std::string& key) const override;
  std::optional<std::string> link(const std::string& key, const LinkedAs& as) const override;
  std::shared_ptr<const void> hold_bytes(const std::string& /*key*/) const override {
    return nullptr;
  }
  void erase(const std::string& key) override;
  void mark_named(const std::string& key) override;
  std::vector<std::string> erase_unnamed(std::span<const std::string> keys, Steady spare_since,
                                         const Names& names) override;
  Swept sweep(Steady spare_since, const Names& names) override;
  std::size_t empty_quarantine(Time before, const Names& names) override;

 private:
  class Writer;

  std::uint64_t disk_capacity() const override { return folder_.reserve().capacity(); }
  // The copy that was just made. Stays readable if another thread erases the blob.
  File open_copy(const std::string& key) const;
  // Uploads the bytes of a local copy as a blob. The copy may be erased meanwhile.
  void store(const Blob& blob, const File& bytes, const std::string& owner,
             const std::stop_token& stop);
  void put(const Blob& blob, const File& bytes, const std::stop_token& stop);
  void wait_until_not_going(const std::string& key, const std::stop_token& stop);
  bool fetch(const std::string& key, const std::stop_token& stop) const;
  bool fetch_once(const std::string& key, std::uint64_t bytes, const std::stop_token& stop) const;
  bool is_held(const std::string& key, std::chrono::nanoseconds oldest) const;
  bool take_out(const std::string& key, Steady spare_since, const Names& names);
  bool is_time_to_sweep();
  // The held blobs. Removes holds that are too old.
  std::set<std::string> tidy_holds(std::chrono::nanoseconds oldest);
  void tidy_going();

  const S3Options options_;
  const DataFolder& folder_;
  S3Client client_;
  mutable BlobCache cache_;
  mutable HealthCheck health_;
  UnnamedBlobs unnamed_;
  mutable KeyedTurns fetches_;
  mutable Mutex mutex_;
  // Blobs in the bucket with wrong bytes.
  mutable std::set<std::string> damaged_ ISOMESH_GUARDED_BY(mutex_);
  Steady next_sweep_ ISOMESH_GUARDED_BY(mutex_);
  // As given to the last sweep; before the first one every blob counts as recent.
  Steady spare_since_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::store
