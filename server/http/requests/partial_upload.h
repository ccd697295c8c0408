// A body that comes in several requests, in a file that outlives the process.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "base/descriptor.h"
#include "base/mutex.h"
#include "server/http/requests/request.h"
#include "server/http/requests/upload.h"

namespace isomesh::http {

// What is known of such a body beside its bytes.
struct PartialNote {
  std::string owner;
  Parameters query;       // of the request that began it
  std::string file_name;  // as Upload's
  std::string sha256;     // that all of it must have, in hex; empty: none was told
  std::optional<std::uint64_t> length = {};
  bool is_complete = false;
  std::string volume = {};  // that it has become, as JSON; its bytes are gone then

  bool operator==(const PartialNote&) const = default;
};

// To whom it falls to append.
struct PartialTurn {
  std::uint64_t number = 0;
  std::uint64_t offset = 0;  // bytes that were there when it began
};

// Two files in the folder: the bytes, and beside them the note, which is written before the first
// of these. Both stay for a process that comes after this one, unless let_go() was called. A kill
// takes nothing that write() has written; when the machine starts anew nothing is believed.
//
// Thread safe. Bytes are written by whoever has the latest turn, and how many there are is told to
// nobody without ending it, so that what was told stays true.
class PartialUpload {
 public:
  using Turn = PartialTurn;

  // Begins one. Throws Error kOutOfSpace or kInternal.
  PartialUpload(const std::filesystem::path& folder, std::string name, PartialNote note);
  // Goes on with one that an earlier process began. Throws Error kGone where it cannot be believed.
  PartialUpload(const std::filesystem::path& folder, std::string name);
  ~PartialUpload();
  PartialUpload(const PartialUpload&) = delete;
  PartialUpload& operator=(const PartialUpload&) = delete;

  const std::string& name() const { return name_; }
  PartialNote note() const ISOMESH_EXCLUDES(mutex_);
  // What is to be read, once it is complete; its file stays for as long as somebody has this. Null
  // when it has become a volume.
  std::shared_ptr<const ReceivedBody> body() const ISOMESH_EXCLUDES(mutex_);

  // Its bytes so far, for those who count what all take.
  std::uint64_t bytes() const ISOMESH_EXCLUDES(mutex_);
  // When something was written last, by this process or an earlier one.
  std::filesystem::file_time_type written_at() const;

  // Ends whatever turn there is, and says how many bytes are there.
  std::uint64_t end_turns() ISOMESH_EXCLUDES(mutex_);
  // A turn to append, which ends the one before. Nothing where there are other than so many bytes.
  std::optional<Turn> begin_turn(std::uint64_t offset) ISOMESH_EXCLUDES(mutex_);

  // Each throws Error kUnavailable when another turn has begun, kInvalidParameter when the upload
  // is complete or its length, once it is told, is another one; write() also as write_all does.
  void tell_length(const Turn& turn, std::uint64_t length) ISOMESH_EXCLUDES(mutex_);
  void write(const Turn& turn, std::span<const std::byte> bytes) ISOMESH_EXCLUDES(mutex_);
  // Goes back to where the turn began.
  void take_back(const Turn& turn) ISOMESH_EXCLUDES(mutex_);
  void complete(const Turn& turn) ISOMESH_EXCLUDES(mutex_);

  // It has become a volume: its bytes go, and what it became stays known.
  void become(const std::string& volume) ISOMESH_EXCLUDES(mutex_);

  // Both files go when this does.
  void let_go() ISOMESH_EXCLUDES(mutex_);

 private:
  // The file of the bytes; removed with the last who has it once it is to go.
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
  void check(const Turn& turn) const ISOMESH_REQUIRES(mutex_);
  void write_note() const ISOMESH_REQUIRES(mutex_);

  const std::string name_;
  const std::filesystem::path path_;
  const std::filesystem::path note_path_;
  mutable Mutex mutex_;
  std::shared_ptr<File> bytes_file_ ISOMESH_GUARDED_BY(mutex_) = std::make_shared<File>(path_);
  PartialNote note_ ISOMESH_GUARDED_BY(mutex_);
  Descriptor file_ ISOMESH_GUARDED_BY(mutex_);
  std::uint64_t bytes_ ISOMESH_GUARDED_BY(mutex_) = 0;
  std::uint64_t turn_ ISOMESH_GUARDED_BY(mutex_) = 0;  // the number of the latest
  bool is_let_go_ ISOMESH_GUARDED_BY(mutex_) = false;
};

}  // namespace isomesh::http
