#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/files/files.h"
#include "server/store/files/room.h"

namespace isomesh::store {

// Blobs as files of the data folder, which must outlive it.
class FileBlobStore : public BlobStore {
 public:
  explicit FileBlobStore(const DataFolder& folder);

  // How many bytes all blobs may take, 0 for as many as the disk holds, and what makes room. To be
  // called before anything is stored.
  void limit_room(std::uint64_t max_bytes, Room::Make make) {
    room_.limit(max_bytes, std::move(make));
  }

  std::unique_ptr<BlobWriter> begin() const override;
  bool has_room() const override { return folder_.reserve().has_room(); }
  std::uint64_t bytes() const override { return room_.used(); }
  std::uint64_t capacity() const override;
  void adopt(const std::filesystem::path& file, const Blob& blob) const override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override;
  LocalBlob local(const std::string& key) const override;
  // A file that was hashed whole, to become a blob or by this, is believed for an hour, unless its
  // device, inode, size or times change.
  bool is_intact(const std::string& key, const std::stop_token& stop) const override;
  std::optional<std::uint64_t> size(const std::string& key) const override;
  void erase(const std::string& key) const override;
  void settle(const std::string& key) const override;
  std::vector<std::string> erase_unnamed(std::span<const std::string> keys, Steady unsettled,
                                         const Names& names) const override;
  Swept sweep(Steady unsettled, const Names& names) const override;
  std::size_t empty_quarantine(Time before) const override;

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

  // How often a blob was stored by this process without being settled, and when last.
  struct Unsettled {
    std::size_t times = 0;
    Steady last;
  };

  void believe(const std::string& key, const std::string& traits) const;
  // `file` is the open one of that path, and `taken` of its bytes are taken from the room already.
  // Returns its traits in its place.
  std::string publish_as(const std::filesystem::path& path, const File& file,
                         const std::string& key, std::uint64_t taken) const;
  void make_folder_for(const std::filesystem::path& place) const;
  // As path_of, for reading: what is in quarantine is put back.
  std::filesystem::path found(const std::string& key) const;
  std::vector<std::string> all_keys() const;
  void note_unsettled(const std::string& key) const ISOMESH_REQUIRES(places_);
  bool is_unsettled(const std::string& key, Steady since) const ISOMESH_REQUIRES(places_);

  const DataFolder& folder_;
  mutable Room room_;
  // Held while a file takes its place or is swept, so that the sweeper never erases a file that has
  // just been put there anew.
  mutable Mutex places_;
  mutable std::map<std::string, Unsettled> unsettled_ ISOMESH_GUARDED_BY(places_);
  mutable Mutex folders_mutex_;
  mutable bool has_folders_ ISOMESH_GUARDED_BY(folders_mutex_) = false;  // all, on the disk
  mutable Mutex intact_mutex_;
  mutable std::map<std::string, Check> intact_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable Steady next_forgetting_ ISOMESH_GUARDED_BY(intact_mutex_);
  mutable Condition checked_;
  mutable std::set<std::string> under_check_ ISOMESH_GUARDED_BY(intact_mutex_);
};

}  // namespace isomesh::store
