#pragma once

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
#include "server/store/files/data_folder.h"
#include "server/store/files/files.h"
#include "server/store/files/folder_holds.h"
#include "server/store/files/room.h"
#include "server/store/probe.h"
#include "server/store/unsettled.h"

namespace isomesh::store {

// Blobs as files: of the data folder, or of one that several daemons share.
class FileBlobStore : public BlobStore {
 public:
  // Of the data folder, which must outlive it.
  explicit FileBlobStore(const DataFolder& folder)
      : FileBlobStore(folder.blob_folders(), folder.reserve()) {}

  // Of folders anywhere. The reserve is that of this machine's disk, and must outlive it.
  FileBlobStore(BlobFolders folders, Reserve& reserve);

  void limit_room(std::uint64_t max_bytes, MakeRoom make) override {
    room_.limit(max_bytes, std::move(make));
  }

  // One that is shared makes and removes a file.
  bool answers() const override;
  bool is_shared() const override { return holds_.has_value(); }
  bool is_empty() const override;
  std::string mark() const override;
  void set_mark(const std::string& text) const override;
  std::unique_ptr<BlobWriter> begin() const override;
  bool has_room() const override;
  std::uint64_t bytes() const override { return room_.used(); }
  std::uint64_t capacity() const override;
  void adopt(const std::filesystem::path& file, const Blob& blob) const override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override;
  LocalBlob local(const std::string& key) const override;
  // A file that was hashed whole, to become a blob or by this, is believed for an hour, unless its
  // device, inode, size or times change.
  bool is_intact(const std::string& key, const std::stop_token& stop) const override;
  std::optional<std::uint64_t> size(const std::string& key) const override;
  std::optional<std::string> link(const std::string& /*key*/,
                                  const LinkedAs& /*as*/) const override {
    return std::nullopt;
  }
  std::shared_ptr<const void> hold_bytes(const std::string& key) const override;
  void erase(const std::string& key) const override;
  void settle(const std::string& key) const override;
  std::vector<std::string> erase_unnamed(std::span<const std::string> keys, Steady unsettled,
                                         const Names& names) const override;
  Swept sweep(Steady unsettled, const Names& names) const override;
  std::size_t empty_quarantine(Time before, const Names& names) const override;

  // The keys of all blobs that are not in quarantine.
  std::vector<std::string> keys() const;

  // Where a blob lies or would.
  std::filesystem::path path_of(const std::string& key) const;

 private:
  class Writer;
  class CheckUnderWay;

  // When a file was found intact, and what it looked like then.
  struct Check {
    std::string traits;
    Steady when;
  };

  void believe(const std::string& key, const std::string& traits) const;
  // `file` is the open one of that path, and `taken` of its bytes are taken from the room already.
  // Returns its traits in its place.
  std::string publish_as(const std::filesystem::path& path, const File& file,
                         const std::string& key, std::uint64_t taken) const;
  void make_folder_for(const std::filesystem::path& place) const;
  // As path_of, for reading: what is in quarantine is put back.
  std::filesystem::path found(const std::string& key) const;
  void copy_in(const std::filesystem::path& file, const Blob& blob) const;
  // Bytes of the disk that the blobs are on.
  std::uint64_t disk_capacity() const;
  // Of a shared folder: erases the blob unless somebody holds or names it; false when it is there
  // still.
  bool take_out(const std::string& key, std::chrono::nanoseconds oldest_hold,
                const Names& names) const ISOMESH_REQUIRES(places_);
  // Into quarantine. Returns whether it is there now and was not before.
  bool put_aside(const std::string& key) const ISOMESH_REQUIRES(places_);
  // Of a shared folder: takes those back that somebody held or named meanwhile. Returns how many.
  std::size_t look_again(std::span<const std::string> keys, std::chrono::nanoseconds oldest_hold,
                         const Names& names) const;
  // Of a shared folder: what daemons that died have left, and what all blobs take.
  void tidy_shared(std::chrono::nanoseconds oldest_hold) const;
  std::uint64_t counted_bytes() const;
  std::set<std::string> held(std::chrono::nanoseconds oldest) const;

  const BlobFolders folders_;
  Reserve& reserve_;
  const std::optional<FolderHolds> holds_;  // of a folder that others may have too
  mutable Probe probe_;
  mutable Room room_;
  // Held while a file takes its place or is swept, so that the sweeper never erases a file that has
  // just been put there anew.
  mutable Mutex places_;
  mutable Unsettled unsettled_ ISOMESH_GUARDED_BY(places_);
  mutable Mutex folders_mutex_;
  mutable bool has_folders_ ISOMESH_GUARDED_BY(folders_mutex_) = false;  // all, on the disk
  mutable Mutex intact_mutex_;
  mutable std::map<std::string, Check> intact_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable Steady next_forgetting_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable Condition checked_;
  mutable std::set<std::string> under_check_ ISOMESH_GUARDED_BY(intact_mutex_);
};

}  // namespace isomesh::store
