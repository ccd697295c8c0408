#include "server/jobs/volume_library.h"

namespace isomesh::jobs {

std::pair<Volume, bool> VolumeLibrary::add(const std::filesystem::path& upload,
                                           const volume::ImportOptions& options) {
  const store::ScratchFolder scratch(folder_.scratch());
  const std::filesystem::path canonical = scratch.path() / "canonical";
  Volume volume =
      options.raw ? volume::import_raw(upload, *options.raw, limits_, canonical)
                  : volume::import_file(upload, options.series, scratch.path(), limits_, canonical);
  const store::Blob blob = store::digest_of(canonical);
  const std::lock_guard lock(mutex_);
  blobs_.adopt(canonical, blob);
  volume.id = blob.key;
  volume.created = store::timestamp();
  return volumes_.add(volume);
}

void VolumeLibrary::erase(const std::string& id) {
  const std::lock_guard lock(mutex_);
  if (volumes_.contains(id) && jobs_.needs_volume(id)) {
    throw Error(ErrorCode::kNotReady, "jobs that are not finished need this volume");
  }
  volumes_.erase(id);
  blobs_.erase(id);
}

}  // namespace isomesh::jobs
