#pragma once

#include <map>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/store/data_folder.h"

namespace isomesh::store {

// The records of the volumes that are there, one small file each. Thread safe; `folder` must
// outlive it. A record is added after its blob and erased before it, so it never names one that is
// missing.
class VolumeStore {
 public:
  // Reads the records that are there; see unreadable().
  explicit VolumeStore(const DataFolder& folder);

  // The ids of records that were there but could not be read: left where they are, for a person.
  const std::vector<std::string>& unreadable() const { return unreadable_; }

  // Adds a record, or returns the one that has the same id already. Second: whether it is new.
  std::pair<Volume, bool> add(const Volume& volume);

  // Throws Error kNotFound.
  Volume get(const std::string& id) const;

  bool contains(const std::string& id) const;

  // Oldest first.
  std::vector<Volume> list() const;

  // Throws Error kNotFound.
  void erase(const std::string& id);

 private:
  std::filesystem::path path_of(const std::string& id) const;

  const DataFolder& folder_;
  std::vector<std::string> unreadable_;  // constant after construction
  mutable std::mutex mutex_;
  std::map<std::string, Volume> volumes_;  // guarded by mutex_
};

}  // namespace isomesh::store
