#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "server/store/files/reserve.h"

namespace isomesh::store {

// A file in a data folder that is being put back from a backup.
inline constexpr const char* kUnfinishedRestore = "restoring";

// Where a store of files has its blobs.
struct BlobFolders {
  std::filesystem::path blobs;       // finished files, by digest
  std::filesystem::path quarantine;  // blobs that nothing names, before they are removed for good
  std::filesystem::path drafts;      // unfinished files; on the same file system as the blobs
  std::filesystem::path holds = {};  // of a folder that several daemons share; see FolderHolds
  bool outlive_crashes = true;       // each file is brought to the disk before it is a blob
};

// The folders of blobs below one that several daemons may share, which is there: one that is not
// mounted is not made. Throws Error kUnavailable when it is not there, and what making folders
// throws.
BlobFolders shared_blob_folders(const std::filesystem::path& root);

// The one folder that a daemon keeps everything in. Holding it locks it: a second daemon on the
// same folder is refused. Thread safe.
class DataFolder {
 public:
  // Creates what is missing and empties the scratch folder, which holds what a crash cut short.
  // Keeps so many bytes in reserve; by default as many as are usual on a disk of that size. Throws
  // Error kUnavailable when another process holds the folder or its restore did not end,
  // kOutOfSpace or kInternal otherwise.
  explicit DataFolder(const std::filesystem::path& root, std::optional<std::uint64_t> reserve = 0);
  ~DataFolder();
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  std::filesystem::path blobs() const { return root_ / "blobs"; }  // finished files, by digest
  BlobFolders blob_folders() const { return {blobs(), quarantine(), scratch()}; }
  // Copies of blobs that are elsewhere, in folders of the same form. Created when it is asked for.
  BlobFolders cache_folders() const;
  // Blobs that nothing names, before they are removed for good.
  std::filesystem::path quarantine() const { return root_ / "quarantine"; }
  std::filesystem::path records() const { return root_ / "isomesh.sqlite"; }  // the database
  std::filesystem::path scratch() const { return root_ / "scratch"; }         // unfinished files
  // Bodies that come in parts, which outlive the process. Made by who keeps them.
  std::filesystem::path uploads() const { return root_ / "uploads"; }
  Reserve& reserve() const { return *reserve_; }

  // A name of its own, given when it is asked for first. Throws Error kOutOfSpace or kInternal.
  std::string name() const;

 private:
  std::filesystem::path root_;
  int lock_ = -1;
  std::unique_ptr<Reserve> reserve_;
};

// A folder of its own below `parent`, removed with all it holds when it goes. Not thread safe.
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
