// A resumable upload: a body sent in several requests, in a file that survives the process.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "base/descriptor.h"
#include "base/mutex.h"
#include "server/http/requests/request.h"
#include "server/http/requests/upload.h"

namespace isomesh::http {

struct PartialNote {
  std::string owner;
  Parameters query;  // of its first request
  import::UploadName upload_name;
  std::string sha256;  // expected hash of all bytes, in hex; empty if unknown
  std::optional<std::uint64_t> length = {};
  bool is_complete = false;
  std::string volume = {};    // the resulting volume as JSON; then the bytes are deleted
  Parameters read_with = {};  // the options that it was read with

  bool operator==(const PartialNote&) const = default;
};

struct PartialLease {
  std::uint64_t number = 0;
  std::uint64_t offset = 0;  // number of bytes when it began
};

// Two files in the folder: the bytes, and the note, which is written first. Both stay for a later
// process, unless let_go() was called. A kill loses nothing that write() has written; after a
// reboot uploads are invalid.
//
// Thread safe. Only the latest lease may write. Reporting the number of bytes ends the lease, so a
// reported number stays true.
class PartialUpload {
 public:
  using Lease = PartialLease;

  // Begins an upload. Throws Error kOutOfSpace or kInternal.
  PartialUpload(const std::filesystem::path& folder, std::string name, PartialNote note);
  // Resumes the upload of an earlier process. Throws Error kGone if it is invalid.
  PartialUpload(const std::filesystem::path& folder, std::string name);
  ~PartialUpload();
  PartialUpload(const PartialUpload&) = delete;
  PartialUpload& operator=(const PartialUpload&) = delete;

  const std::string& name() const { return name_; }
  PartialNote note() const ISOMESH_EXCLUDES(mutex_);
  // The complete body; its file exists as long as the returned object. Null if it has become a
  // volume.
  std::shared_ptr<const ReceivedBody> body() const ISOMESH_EXCLUDES(mutex_);

  // The number of bytes so far, for the total over all uploads.
  std::uint64_t bytes() const ISOMESH_EXCLUDES(mutex_);
  // The time of the last write, by this process or an earlier one.
  std::filesystem::file_time_type written_at() const;

  // Ends any lease and returns the number of bytes.
  std::uint64_t end_leases() ISOMESH_EXCLUDES(mutex_);
  // Begins a lease to append, which ends the previous one. Empty unless there are exactly `offset`
  // bytes.
  std::optional<Lease> begin_lease(std::uint64_t offset) ISOMESH_EXCLUDES(mutex_);

  // All throw Error kUnavailable if another lease has begun, kCancelled after cancel(),
  // kInvalidParameter if the upload is complete or `length` contradicts an earlier one; write()
  // also throws as write_all does.
  void tell_length(const Lease& lease, std::uint64_t length) ISOMESH_EXCLUDES(mutex_);
  void write(const Lease& lease, std::span<const std::byte> bytes) ISOMESH_EXCLUDES(mutex_);
  // Truncates to the start of the lease.
  void take_back(const Lease& lease) ISOMESH_EXCLUDES(mutex_);
  void complete(const Lease& lease) ISOMESH_EXCLUDES(mutex_);

  // Records the resulting volume and the options that it was read with, and deletes the bytes.
  void become(const std::string& volume, const Parameters& read_with) ISOMESH_EXCLUDES(mutex_);

  // Deletes both files with this object.
  void let_go() ISOMESH_EXCLUDES(mutex_);

  // One per request that makes volumes of the complete upload, for as long as that takes.
  class Reading {
   public:
    // `upload` is null for an upload that cannot be cancelled. Throws Error kCancelled if it was.
    explicit Reading(std::shared_ptr<PartialUpload> upload);
    ~Reading();
    Reading(const Reading&) = delete;
    Reading& operator=(const Reading&) = delete;

    std::stop_token cancelled() const;
    // Call with the id of each stored volume.
    void stored(const std::string& id) const;

   private:
    const std::shared_ptr<PartialUpload> upload_;
  };

  // Cancels all readings, waits until they have ended and returns the ids of the volumes that they
  // had stored by then. So nothing is stored later.
  std::vector<std::string> cancel() ISOMESH_EXCLUDES(mutex_);

 private:
  // The file of the bytes; its last owner removes it if `goes` is set.
  struct File {
    explicit File(std::filesystem::path path) : body{.path = std::move(path), .name = {}} {}
    ~File();
    File(const File&) = delete;
    File& operator=(const File&) = delete;

    ReceivedBody body;
    std::atomic<bool> goes = false;
  };

  std::uint64_t offset() const ISOMESH_REQUIRES(mutex_);
  void cut(std::uint64_t bytes) ISOMESH_REQUIRES(mutex_);
  void check(const Lease& lease) const ISOMESH_REQUIRES(mutex_);
  void write_note() const ISOMESH_REQUIRES(mutex_);

  const std::string name_;
  const std::filesystem::path path_;
  const std::filesystem::path note_path_;
  mutable Mutex mutex_;
  std::shared_ptr<File> bytes_file_ ISOMESH_GUARDED_BY(mutex_) = std::make_shared<File>(path_);
  PartialNote note_ ISOMESH_GUARDED_BY(mutex_);
  Descriptor file_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t bytes_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t lease_ ISOMESH_GUARDED_BY(mutex_) = 0;
  bool is_let_go_ ISOMESH_GUARDED_BY(mutex_) = false;
  std::stop_source cancelled_;
  Condition reading_ended_;
  std::size_t readings_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::vector<std::string> stored_ ISOMESH_GUARDED_BY(mutex_);
};

}  // namespace isomesh::http
