#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "proto/types.h"
#include "server/import/message/import_message.h"
#include "server/import/message/upload_name.h"
#include "server/jobs/library/blob_eraser.h"
#include "server/jobs/library/import_runner.h"
#include "server/store/blob_store.h"
#include "server/store/files/data_folder.h"
#include "server/store/retention.h"
#include "server/store/volume_store.h"
#include "server/volume/geometry.h"

namespace isomesh::jobs {

using import::UploadName;

// Lets another thread cancel imports.
struct ImportControl {
  std::stop_token cancelled = {};
  // Called with the id of each stored volume, also of one that the owner already had. Volumes that
  // are stored before the cancellation stay.
  std::function<void(const std::string& id)> stored = {};
};

// Adds and erases volumes so that records, blobs and the jobs that need them stay consistent.
// Thread safe; its dependencies must outlive it.
class VolumeLibrary {
 public:
  VolumeLibrary(const store::DataFolder& folder, store::BlobStore& blobs,
                store::VolumeStore& volumes, store::Retention& retention,
                const volume::SizeLimits& limits, const RunnerOptions& runner)
      : folder_(folder),
        blobs_(blobs),
        volumes_(volumes),
        retention_(retention),
        limits_(limits),
        runner_(runner) {}

  // Imports an uploaded file in a process of its own. `party` takes turns with others
  // (ImportPlaces). Second: false if the owner already had the volume: the same samples, and
  // everything else that the upload says. Then the record keeps the format, the ignored files and,
  // unless one was chosen now, the name of the first upload, but the returned volume has this one's
  // format and ignored files. Throws what ImportRunner::run throws, also while the bytes are
  // stored, and kOutOfSpace. It stores nothing if it throws kCancelled.
  std::pair<Volume, bool> add(const std::string& owner, const std::filesystem::path& upload,
                              const ImportOptions& options = {}, const UploadName& name = {},
                              const std::string& party = {}, const ImportControl& control = {});

  // Imports a series from a PACS response; the volume has a DICOM identity. It stores nothing if it
  // throws kCancelled.
  Volume add_peers(const std::string& owner, const std::filesystem::path& response,
                   const PeersSeries& series, const ImportControl& control = {});

  // Imports all volumes of an upload, each in a process of its own, one after the other. Each
  // element has a volume or its error, unless that is an internal one, which is thrown. If the
  // options choose a member or the upload has only one volume, there is one element with the chosen
  // member, and its error is thrown. A cancellation is thrown, too.
  std::vector<UploadedVolume> add_all(const std::string& owner, const std::filesystem::path& upload,
                                      const ImportOptions& options, const UploadName& name,
                                      const std::string& party, const ImportControl& control = {});

  // Renames the owner's volume; an empty name removes it. Throws Error kNotFound, kGone.
  Volume rename(const std::string& owner, const std::string& id,
                const std::optional<std::string>& name) {
    return volumes_.rename(owner, id, name);
  }

  // Stores a flipped or turned copy of the owner's volume, as volume::reoriented makes it, with its
  // axes in the canonical order and a note on all changes since its upload. The copy of a DICOM
  // volume refers neither to the images nor to their frame of reference: its positions are others.
  // Second: false if the owner already had it. Throws Error kNotFound, kGone, kOutOfSpace;
  // kUnusableVolume if the volume is damaged or cannot be turned; and as
  // ImportRunner::until_stopped does.
  std::pair<Volume, bool> reorient(const std::string& owner, const std::string& id,
                                   const volume::AxisOrder& order);

  // Aborts running and waiting imports and the storing of their bytes, and rejects further ones.
  void stop_imports() { runner_.stop(); }

  // Erases the records visible to the viewer, and those of the ended jobs on them if `made` says
  // so. Their files are erased soon after the last record that names them, or after the next start
  // if this object is destroyed before. Throws Error kNotFound, kGone, and kNotReady while a job
  // needs the volume.
  void erase(const store::Viewer& viewer, const std::string& id,
             store::Made made = store::Made::kKept);

  // Erases the record of an ended job, and its files as above. Returns false, and changes nothing,
  // if the job is queued or running. Throws Error kNotFound and kGone.
  bool erase_job(store::JobStore& jobs, const store::Viewer& viewer, const std::string& id);

  // Returns once the files of what was erased are gone, or `stop` is requested.
  void finish_erasing(const std::stop_token& stop = {}) { eraser_.finish(stop); }

 private:
  // Writes the canonical file of the upload into the scratch folder.
  Volume import_file(const std::filesystem::path& upload, const ImportOptions& options,
                     const std::string& party, const store::ScratchFolder& scratch,
                     const std::stop_token& cancelled);
  // Makes that file a blob, and adds the volume to the owner's records.
  std::pair<Volume, bool> keep(const std::string& owner, Volume volume,
                               const store::ScratchFolder& scratch, const ImportControl& control);

  const store::DataFolder& folder_;
  store::BlobStore& blobs_;
  store::VolumeStore& volumes_;
  store::Retention& retention_;
  const volume::SizeLimits limits_;
  ImportRunner runner_;
  BlobEraser eraser_{blobs_, volumes_, folder_.erasing()};
};

}  // namespace isomesh::jobs
