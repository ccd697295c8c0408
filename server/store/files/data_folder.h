#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/descriptor.h"
#include "base/error.h"
#include "base/held_folder.h"
#include "server/store/files/reserve.h"
#include "server/store/health_check.h"

namespace isomesh::store {

// Exists in a data folder while a backup is being restored into it.
inline constexpr const char* kUnfinishedRestore = "restoring";
// Follows the name of such a folder in errors.
inline constexpr const char* kRestoreAgain =
    "was not restored completely: empty it and restore again";

// Error kUnavailable: a folder is missing for a while, or cannot be written to.
Error missing_folder();

class DataFolder;

// The folders of a FileBlobStore.
struct BlobFolders {
  std::filesystem::path blobs;       // finished files, by digest
  std::filesystem::path quarantine;  // unnamed blobs, before they are removed for good
  std::filesystem::path drafts;      // unfinished files; on the same file system as the blobs
  std::filesystem::path holds = {};  // only for a shared folder; see FolderHolds
  bool outlive_crashes = true;       // sync each file before it becomes a blob
  const DataFolder* data = nullptr;  // the data folder that has them; null for a shared folder
};

// The blob folders below `root`, a folder that several daemons may share. `root` must exist,
// because creating it would hide a missing mount. Throws Error kUnavailable if it is missing, and
// what creating folders throws.
BlobFolders shared_blob_folders(const std::filesystem::path& root);

// The folder with all of a daemon's data. Holds a lock, so a second daemon cannot use the same
// folder. Holds the folder open, and all paths lead into that one: another folder in its place,
// such as that of a second daemon, receives nothing. The paths are valid in this process only (see
// for_other_process). SQLite replaces the path of records() by the real one as it opens the file,
// and leaves the files beside it alone if another file is there at the end. Thread safe.
class DataFolder {
 public:
  // Creates missing folders and empties the scratch folder, which may have unfinished files of a
  // crashed process. Keeps `reserve` bytes in reserve; without a value, as many as usual for the
  // size of the disk. Throws Error kUnavailable if another process has the folder or its restore
  // did not finish; kOutOfSpace or kInternal otherwise.
  explicit DataFolder(const std::filesystem::path& root, std::optional<std::uint64_t> reserve = 0);
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  // False while the folder is not at its place or cannot be written to: it was renamed or
  // unmounted, is mounted read-only, or another folder is in its place. The log says so once, and
  // once when it is back. Fast.
  bool is_there() const;
  // Throws Error kUnavailable unless is_there().
  void check_is_there() const;
  // As is_there(), but also tries to write, because a disk may fail without going away.
  bool works() const;
  // As works(), for those who ask often: remembers the result for 2 s, because writing may take
  // long.
  bool responds() const;

  std::filesystem::path blobs() const { return root() / "blobs"; }  // finished files, by digest
  BlobFolders blob_folders() const;
  // Folders for local copies of remote blobs. Created on the first call.
  BlobFolders cache_folders() const;
  // Unnamed blobs, before they are removed for good.
  std::filesystem::path quarantine() const { return root() / "quarantine"; }
  std::filesystem::path records() const { return root() / "isomesh.sqlite"; }  // the database
  std::filesystem::path scratch() const { return root() / "scratch"; }         // unfinished files
  // Empty files, named like the blobs of deleted volumes that have not been erased yet.
  std::filesystem::path erasing() const { return root() / "erasing"; }
  // Multipart uploads, which outlive the process. Created by their owner.
  std::filesystem::path uploads() const { return root() / "uploads"; }
  Reserve& reserve() const { return *reserve_; }

  // A unique name, generated on the first call. Throws Error kOutOfSpace or kInternal.
  std::string name() const;

 private:
  const std::filesystem::path& root() const { return folder_.path(); }

  const HeldFolder folder_;
  mutable std::atomic<bool> is_missing_ = false;  // by the last look
  mutable HealthCheck health_;
  Descriptor lock_;
  std::unique_ptr<Reserve> reserve_;
};

// A new folder below `parent`, removed with its contents on destruction. Not thread safe.
class ScratchFolder {
 public:
  explicit ScratchFolder(const std::filesystem::path& parent);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace isomesh::store
