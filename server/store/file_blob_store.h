#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <set>
#include <string>

#include "server/store/blob_store.h"
#include "server/store/data_folder.h"
#include "server/store/files.h"

namespace isomesh::store {

// Blobs as files of the data folder, which must outlive it.
class FileBlobStore : public BlobStore {
 public:
  explicit FileBlobStore(const DataFolder& folder) : folder_(folder) {}

  std::unique_ptr<BlobWriter> begin() const override;
  void adopt(const std::filesystem::path& file, const Blob& blob) const override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override;
  LocalBlob local(const std::string& key) const override;
  // A file that was read whole and found intact is believed for an hour, unless its size, times or
  // inode change.
  bool is_intact(const std::string& key, const std::stop_token& stop) const override;
  std::optional<std::uint64_t> size(const std::string& key) const override;
  void erase(const std::string& key) const override;

  // Where a blob lies or would.
  std::filesystem::path path_of(const std::string& key) const;

  // Erases what was written before `cutoff` and is not kept: what a worker or an upload is about
  // to name is younger than that. Returns how many.
  std::size_t sweep(std::chrono::system_clock::time_point cutoff,
                    const std::function<bool(const std::string& key)>& keep) const;

 private:
  class Writer;

  struct Sighting {
    std::string traits;
    std::chrono::steady_clock::time_point when;
  };

  void publish_as(const std::filesystem::path& file, const std::string& key) const;
  void make_folder_for(const std::filesystem::path& place) const;

  const DataFolder& folder_;
  // Held while a file takes its place or is swept, so that the sweeper never erases a file that has
  // just been put there anew.
  mutable std::mutex places_;
  mutable std::mutex synced_mutex_;
  mutable std::set<std::string> synced_;  // folders that are on the disk; guarded by synced_mutex_
  mutable std::mutex intact_mutex_;
  mutable std::map<std::string, Sighting> intact_;  // guarded by intact_mutex_
};

}  // namespace isomesh::store
