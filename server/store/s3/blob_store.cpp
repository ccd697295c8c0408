#include "server/store/s3/blob_store.h"

#include <algorithm>
#include <thread>
#include <utility>

#include "base/ids.h"
#include "base/log.h"
#include "proto/error.h"
#include "server/store/s3/objects.h"

namespace isomesh::store {

class S3BlobStore::Writer : public BlobWriter {
 public:
  Writer(S3BlobStore& store, std::string owner)
      : store_(store), owner_(std::move(owner)), copy_(store.cache_.files().begin(owner_)) {}

  ~Writer() override { store_.room_.finish(stored_, owner_); }

  void write(std::span<const std::byte> bytes) override {
    bytes_ += bytes.size();
    if (bytes_ > store_.capacity()) {
      throw Error(ErrorCode::kTooLarge, "the file is larger than all available space");
    }
    copy_->write(bytes);
  }

  Blob store(const std::stop_token& stop) override {
    const Blob blob = copy_->commit();
    store_.store(blob, store_.open_copy(blob.key), owner_, stop);
    stored_ = blob.bytes;
    return blob;
  }

 private:
  S3BlobStore& store_;
  const std::string owner_;
  const std::unique_ptr<BlobWriter> copy_;
  std::uint64_t bytes_ = 0;
  std::uint64_t stored_ = 0;
};

S3BlobStore::S3BlobStore(const DataFolder& folder, S3Options options)
    : options_(std::move(options)),
      folder_(folder),
      client_(options_.client),
      cache_(folder.cache_folders(), folder.reserve(), options_.cache_bytes) {}

bool S3BlobStore::responds() const {
  return folder_.is_there() && health_.passes([this] { return client_.responds(); });
}

bool S3BlobStore::is_empty() const { return !client_.has_any(kBlobObjects); }

std::string S3BlobStore::mark() const { return client_.get_text(kMarkObject).value_or(""); }

void S3BlobStore::set_mark(const std::string& text) { client_.put_text(kMarkObject, text); }

bool S3BlobStore::has_room() const {
  if (folder_.reserve().has_room()) return true;
  cache_.empty();
  return folder_.reserve().has_room();
}

std::unique_ptr<BlobWriter> S3BlobStore::begin(const std::string& owner) {
  return std::make_unique<Writer>(*this, owner);
}

void S3BlobStore::adopt(const std::filesystem::path& file, const Blob& blob,
                        const std::string& owner, const std::stop_token& stop) {
  const File bytes = File::open(file);
  cache_.files().adopt(file, blob, owner, stop);
  store(blob, bytes, owner, stop);
  room_.finish(blob.bytes, owner);
}

// The caller finishes the bytes.
void S3BlobStore::store(const Blob& blob, const File& bytes, const std::string& owner,
                        const std::stop_token& stop) {
  const auto in_use = cache_.use(blob.key);
  cache_.files().mark_named(blob.key);  // records name the blob in the bucket, not this copy
  cache_.note(blob.key, cache_.files().size(blob.key).value_or(0));
  cache_.make_room(0);
  room_.take(blob.bytes, owner);
  const std::string hold = hold_object(blob.key);
  try {
    client_.put_text(hold, "", stop);
    wait_until_not_going(blob.key, stop);
    put(blob, bytes, stop);
  } catch (...) {
    room_.finish(blob.bytes, owner);
    room_.give(blob.bytes);
    client_.try_to_erase(hold);
    throw;
  }
  unnamed_.note(blob.key, hold);
}

// Evicting an older copy may have removed the new one.
File S3BlobStore::open_copy(const std::string& key) const {
  try {
    return File::open(cache_.files().local(key).path);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kNotFound) throw;
  }
  throw Error(ErrorCode::kUnavailable, "there is no space for a copy in the cache: try again");
}

void S3BlobStore::put(const Blob& blob, const File& bytes, const std::stop_token& stop) {
  const bool is_damaged = [&] {
    const Lock lock(mutex_);
    return damaged_.contains(blob.key);
  }();
  const bool is_new = client_.put_file(blob_object(blob.key), bytes, blob,
                                       is_damaged ? IfThere::kReplace : IfThere::kKeep, stop);
  if (!is_new || is_damaged) room_.give(blob.bytes);
  const Lock lock(mutex_);
  damaged_.erase(blob.key);
}

void S3BlobStore::wait_until_not_going(const std::string& key, const std::stop_token& stop) {
  constexpr std::chrono::milliseconds kPause{250};
  constexpr int kTries = 40;
  for (int n = 0; n < kTries; ++n) {
    const S3Listing going = client_.list(going_objects(key), stop);
    const bool is_going = std::ranges::any_of(going.objects, [&](const S3Object& object) {
      return going.now - object.modified < kLongestGoing;
    });
    if (!is_going) return;
    std::this_thread::sleep_for(kPause);
  }
  throw Error(ErrorCode::kUnavailable, "the same bytes are being erased: try again");
}

std::unique_ptr<BlobReader> S3BlobStore::open(const std::string& key) const {
  const LocalBlob copy = local(key);
  return cache_.files().open(key);
}

LocalBlob S3BlobStore::local(const std::string& key) const {
  auto in_use = cache_.use(key);
  if (!is_intact(key, {})) {
    throw Error(ErrorCode::kInternal, "a file in the storage is damaged");
  }
  return {cache_.files().local(key).path, std::move(in_use)};
}

bool S3BlobStore::is_intact(const std::string& key, const std::stop_token& stop) const {
  const auto in_use = cache_.use(key);
  const KeyedTurns::Turn turn(fetches_, key, stop);
  if (is_there_and_intact(cache_.files(), key, stop)) return true;
  cache_.erase(key);  // a copy that the disk has corrupted
  return fetch(key, stop);
}

// Tries twice, because another server may send the bytes the second time.
bool S3BlobStore::fetch(const std::string& key, const std::stop_token& stop) const {
  const auto bytes = client_.size(blob_object(key));
  if (!bytes && !client_.responds()) {  // a missing bucket also looks like a missing object
    throw Error(ErrorCode::kUnavailable, "the storage of volumes and meshes does not respond");
  }
  if (!bytes) throw Error(ErrorCode::kNotFound, "the file does not exist");
  if (fetch_once(key, *bytes, stop) || fetch_once(key, *bytes, stop)) return true;
  log_error("the storage has wrong bytes for the file {}", key);
  const Lock lock(mutex_);
  damaged_.insert(key);
  return false;
}

bool S3BlobStore::fetch_once(const std::string& key, std::uint64_t bytes,
                             const std::stop_token& stop) const {
  cache_.make_room(bytes);
  if (!has_room()) throw Error(ErrorCode::kOutOfSpace, "the data folder has no space left");
  const std::unique_ptr<BlobWriter> copy = cache_.files().begin("");
  const S3Sink sink = [&](std::span<const std::byte> piece) { copy->write(piece); };
  client_.get(blob_object(key), bytes, sink, stop);
  const Blob blob = copy->commit();
  cache_.files().mark_named(blob.key);
  if (blob.key == key) {
    cache_.note(key, blob.bytes);
    return true;
  }
  const auto others = cache_.use(blob.key);
  cache_.note(blob.key, blob.bytes);
  cache_.erase(blob.key);
  return false;
}

std::optional<std::uint64_t> S3BlobStore::size(const std::string& key) const {
  return client_.size(blob_object(key));
}

std::optional<std::string> S3BlobStore::link(const std::string& key, const LinkedAs& as) const {
  return client_.link(blob_object(key), as);
}

}  // namespace isomesh::store
