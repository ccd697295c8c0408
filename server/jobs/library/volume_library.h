#pragma once

#include <filesystem>
#include <optional>
#include <shared_mutex>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/jobs/library/blob_eraser.h"
#include "server/jobs/library/import_runner.h"
#include "server/process/import_message.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/retention.h"
#include "server/store/volume_store.h"

namespace isomesh::jobs {

// Takes uploads in and volumes out, so that records, blobs and the jobs that need them agree.
// Thread safe; what it is made of must outlive it.
class VolumeLibrary {
 public:
  VolumeLibrary(const store::DataFolder& folder, const store::BlobStore& blobs,
                store::VolumeStore& volumes, store::Retention& retention,
                const volume::SizeLimits& limits, const RunnerOptions& runner)
      : folder_(folder),
        blobs_(blobs),
        volumes_(volumes),
        retention_(retention),
        limits_(limits),
        runner_(runner) {}

  // Imports an uploaded file, in a process of its own. `name` is what the client calls it, for a
  // volume that has no name of its own within the file. Second: false when the owner had the same
  // samples and geometry already; the record stays what it was then, but the volume that is
  // returned has the notes and the ignored files of this upload. Throws what ImportRunner::run
  // throws, and kOutOfSpace.
  std::pair<Volume, bool> add(const std::string& owner, const std::filesystem::path& upload,
                              const process::ImportOptions& options = {},
                              const std::string& name = {});

  // The same for what a PACS has sent of a series. Second: whose images these are, as they say
  // themselves. The record may be of another upload of the same samples, with other names.
  std::pair<Volume, DicomIdentity> add_peers(const std::string& owner,
                                             const std::filesystem::path& answer,
                                             const process::PeersSeries& series);

  // The same for an upload that may hold several volumes: each is imported by a process of its own,
  // one after the other, and answered for. One that the options choose or that is alone is the only
  // element, with an empty member; its error is thrown.
  std::vector<UploadedVolume> add_all(const std::string& owner, const std::filesystem::path& upload,
                                      const process::ImportOptions& options,
                                      const std::string& name);

  // Gives the owner's volume another name, or none. Throws Error kNotFound, kGone.
  Volume rename(const std::string& owner, const std::string& id,
                const std::optional<std::string>& name) {
    return volumes_.rename(owner, id, name);
  }

  // Ends the imports that run or wait, and refuses further ones.
  void stop_imports() { runner_.stop(); }

  // The records that the viewer sees; the samples go soon after the last. Throws Error kNotFound,
  // kGone, and kNotReady while a job needs the volume.
  void erase(const store::Viewer& viewer, const std::string& id);

  // Waits until the samples of erased volumes are gone.
  void finish_erasing() { eraser_.finish(); }

 private:
  // Writes the upload's canonical file into the scratch folder.
  Volume import_file(const std::filesystem::path& upload, const process::ImportOptions& options,
                     const store::ScratchFolder& scratch);
  // Makes that file a blob, and the volume a record of the owner's.
  std::pair<Volume, bool> keep(const std::string& owner, Volume volume,
                               const store::ScratchFolder& scratch);

  const store::DataFolder& folder_;
  const store::BlobStore& blobs_;
  store::VolumeStore& volumes_;
  store::Retention& retention_;
  const volume::SizeLimits limits_;
  ImportRunner runner_;
  // Held while a blob and its record come or go together: shared by those that come, which wait for
  // the disk side by side.
  std::shared_mutex mutex_;
  BlobEraser eraser_{blobs_, volumes_, mutex_};
};

}  // namespace isomesh::jobs
