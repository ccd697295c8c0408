#include "server/jobs/volume_library.h"

#include "base/clock.h"

namespace isomesh::jobs {

std::pair<Volume, bool> VolumeLibrary::add(const std::string& owner,
                                           const std::filesystem::path& upload,
                                           const process::ImportOptions& options,
                                           const std::string& name) {
  const store::ScratchFolder scratch(folder_.scratch());
  const std::filesystem::path canonical = scratch.path() / "canonical";
  Volume volume = runner_.run({.source = upload,
                               .scratch = scratch.path(),
                               .target = canonical,
                               .options = options,
                               .limits = limits_});
  const store::Blob blob = store::digest_of(canonical);
  const std::shared_lock lock(mutex_);
  if (!volumes_.names(blob.key)) retention_.make_room(blob.bytes);
  blobs_.adopt(canonical, blob);
  volume.id = blob.key;
  volume.created = timestamp();
  if (!volume.name && !name.empty()) volume.name = name;
  auto added = volumes_.add(owner, volume);
  blobs_.settle(blob.key);
  return added;
}

void VolumeLibrary::erase(const std::string& owner, const std::string& id) {
  const std::scoped_lock lock(mutex_);
  volumes_.erase(owner, id);
  if (!volumes_.names(id)) blobs_.erase(id);
}

}  // namespace isomesh::jobs
