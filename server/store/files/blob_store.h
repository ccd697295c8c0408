#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/file.h"
#include "server/store/files/data_folder.h"
#include "server/store/files/folder_holds.h"
#include "server/store/health_check.h"
#include "server/store/keyed_turns.h"
#include "server/store/unnamed_blobs.h"

namespace isomesh::store {

// Stores blobs as files in the data folder, or in a folder that several daemons share.
class FileBlobStore : public BlobStore {
 public:
  // Uses the data folder, which must outlive this object.
  explicit FileBlobStore(const DataFolder& folder)
      : FileBlobStore(folder.blob_folders(), folder.reserve()) {}

  // Uses any folders. `reserve` is that of the local disk and must outlive this object.
  FileBlobStore(BlobFolders folders, Reserve& reserve);

  // Creates and removes a file, and compares a shared folder's mark.
  bool responds() const override;
  bool is_shared() const override { return holds_.has_value(); }
  bool is_empty() const override;
  std::string mark() const override;
  void set_mark(const std::string& text) override;
  std::unique_ptr<BlobWriter> begin(const std::string& owner) override;
  bool has_room() const override;
  void adopt(const std::filesystem::path& file, const Blob& blob, const std::string& owner,
             const std::stop_token& stop) override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override;
  LocalBlob local(const std::string& key) const override;
  // A verified file is trusted for an hour, unless its device, inode, size or times change.
  bool is_intact(const std::string& key, const std::stop_token& stop) const override;
  std::optional<std::uint64_t> size(const std::string& key) const override;
  std::optional<std::string> link(const std::string& /*key*/,
                                  const LinkedAs& /*as*/) const override {
    return std::nullopt;
  }
  std::shared_ptr<const void> hold_bytes(const std::string& key) const override;
  void erase(const std::string& key) override;
  void mark_named(const std::string& key) override;
  std::vector<std::string> erase_unnamed(std::span<const std::string> keys, Steady spare_since,
                                         const Names& names) override;
  Swept sweep(Steady spare_since, const Names& names) override;
  std::size_t empty_quarantine(Time before, const Names& names) override;

  // The keys of all blobs outside the quarantine.
  std::vector<std::string> keys() const;

  // The place of a blob, whether it exists or not, as any process finds it.
  std::filesystem::path path_of(const std::string& key) const;

 private:
  class Writer;

  // The time of a successful check and the file's properties then.
  struct Check {
    std::string traits;
    Steady when;
  };

  // False if the folder is missing or another one is in its place: it may not be mounted. The log
  // says once when it is missing and once when it is back.
  bool is_there() const;
  // Throws Error kUnavailable unless is_there().
  void check_is_there() const;
  std::filesystem::path place_of(const std::string& key) const;
  // True if is_there() and files can be written.
  bool works() const;
  // Returns the result of `read`. If that fails, checks that the folder is there and reads once
  // more, because a shared folder may have been missing for a moment.
  template <class Read>
  auto read_in_folder(const Read& read) const;
  // Returns the result of `write`. If that fails because the folder is missing, throws Error
  // kUnavailable. In a shared folder, a missing file means that the folder is missing.
  template <class Write>
  auto write_in_folder(const Write& write) const;
  std::optional<std::uint64_t> size_now(const std::string& key) const;
  // True if the file was found intact while it had these properties.
  bool is_believed(const std::string& key, const std::string& traits) const;
  void believe(const std::string& key, const std::string& traits) const;
  // Publishes `path`, open as `file`, as a blob. `taken` bytes are already taken from the room.
  // Returns the properties of the published file.
  std::string publish_as(const std::filesystem::path& path, const File& file,
                         const std::string& key, std::uint64_t taken);
  void make_folder_for(const std::filesystem::path& place);
  // As path_of, for reading: brings the blob back from quarantine.
  std::filesystem::path found(const std::string& key) const;
  void copy_in(const std::filesystem::path& file, const Blob& blob, const std::string& owner,
               const std::stop_token& stop);
  std::uint64_t disk_capacity() const override;
  // For a shared folder: erases the blob unless it is held or named. Returns false if it still
  // exists.
  bool take_out(const std::string& key, std::chrono::nanoseconds oldest_hold, const Names& names)
      ISOMESH_REQUIRES(places_);
  // Moves a blob into quarantine. Returns false if another daemon has moved or erased it.
  bool put_aside(const std::string& key) ISOMESH_REQUIRES(places_);
  // For a shared folder: brings back those that were held or named meanwhile. Returns their number.
  std::size_t look_again(std::span<const std::string> keys, std::chrono::nanoseconds oldest_hold,
                         const Names& names);
  // For a shared folder: removes files left by dead daemons, and recounts the size of all blobs.
  void tidy_shared(std::chrono::nanoseconds oldest_hold);
  std::uint64_t counted_bytes() const;
  std::set<std::string> held(std::chrono::nanoseconds oldest) const;

  const BlobFolders folders_;
  Reserve& reserve_;
  std::optional<FolderHolds> holds_;  // only for a shared folder
  mutable HealthCheck health_;
  mutable std::atomic<bool> is_missing_ = false;  // the shared folder, by the last look
  mutable Mutex mark_mutex_;
  // The database's name in the mark, as read or written first; empty if there is none yet.
  mutable std::string name_ ISOMESH_GUARDED_BY(mark_mutex_);
  // Held while a file is moved to its place or is swept, so that a sweep never erases a file that
  // was just stored again.
  Mutex places_;
  UnnamedBlobs unnamed_;
  Mutex folders_mutex_;
  // True once all folders are on disk.
  bool has_folders_ ISOMESH_GUARDED_BY(folders_mutex_) = false;
  mutable Mutex intact_mutex_;
  mutable std::map<std::string, Check> intact_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable Steady next_forgetting_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable KeyedTurns checks_;  // others wait for the result
};

}  // namespace isomesh::store
