#include "server/store/volume_store.h"

#include <algorithm>

#include "proto/json.h"
#include "server/store/files.h"

namespace isomesh::store {
namespace {

Error unknown_volume() { return {ErrorCode::kNotFound, "there is no volume with this id"}; }

}  // namespace

VolumeStore::VolumeStore(const DataFolder& folder) : folder_(folder) {
  for (const auto& entry : std::filesystem::directory_iterator(folder_.volumes())) {
    if (entry.path().extension() != ".json") continue;  // a write that a crash cut short
    try {
      const Volume volume = volume_from_json(read_whole(entry.path()));
      volumes_.emplace(volume.id, volume);
    } catch (const Error&) {
      unreadable_.push_back(entry.path().stem());
    }
  }
}

std::pair<Volume, bool> VolumeStore::add(const Volume& volume) {
  const std::lock_guard lock(mutex_);
  if (const auto found = volumes_.find(volume.id); found != volumes_.end()) {
    return {found->second, false};
  }
  write_whole(path_of(volume.id), to_json(volume));
  volumes_.emplace(volume.id, volume);
  return {volume, true};
}

Volume VolumeStore::get(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  const auto found = volumes_.find(id);
  if (found == volumes_.end()) throw unknown_volume();
  return found->second;
}

bool VolumeStore::contains(const std::string& id) const {
  const std::lock_guard lock(mutex_);
  return volumes_.contains(id);
}

std::vector<Volume> VolumeStore::list() const {
  std::vector<Volume> all;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, volume] : volumes_) all.push_back(volume);
  }
  std::ranges::sort(all, {},
                    [](const Volume& volume) { return std::pair(volume.created, volume.id); });
  return all;
}

void VolumeStore::erase(const std::string& id) {
  const std::lock_guard lock(mutex_);
  if (!volumes_.contains(id)) throw unknown_volume();
  std::filesystem::remove(path_of(id));
  volumes_.erase(id);
}

std::filesystem::path VolumeStore::path_of(const std::string& id) const {
  return folder_.volumes() / (id + ".json");
}

}  // namespace isomesh::store
