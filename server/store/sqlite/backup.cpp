#include "server/store/sqlite/backup.h"

#include <algorithm>
#include <cerrno>
#include <optional>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/files.h"
#include "base/hex.h"
#include "base/sha256.h"
#include "proto/error.h"
#include "server/store/file.h"
#include "server/store/files/data_folder.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/sqlite.h"

namespace isomesh::store {
namespace {

namespace fs = std::filesystem;

constexpr int kTries = 5;
// The layout of DataFolder and FileBlobStore.
constexpr const char* kRecords = "isomesh.sqlite";
constexpr const char* kBlobs = "blobs";
constexpr const char* kIdentity = "identity";

[[noreturn]] void refuse(const fs::path& path, const std::string& why) {
  throw Error(ErrorCode::kInvalidParameter, path.string() + " " + why);
}

void make_folder(const fs::path& folder) {
  if (::mkdir(folder.c_str(), 0700) != 0 && errno != EEXIST) {
    throw Error(ErrorCode::kInternal,
                folder.string() + ": " + std::generic_category().message(errno));
  }
}

struct Amount {
  std::uint64_t blobs = 0;
  std::uint64_t bytes = 0;
  std::set<std::string> damaged;  // keys
};

// Copies one file and syncs it. Returns false, leaving nothing, if the source is missing.
bool copy_file(const fs::path& from, const fs::path& to, Amount& copied) {
  std::optional<File> source;
  try {
    source.emplace(File::open(from));
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kNotFound) return false;
    throw;
  }
  std::error_code absent;
  fs::remove(to, absent);
  File target = File::create(to);
  Sha256 digest;
  copied.bytes += source->read([&](std::span<const std::byte> bytes) {
    digest.update(bytes);
    target.write(bytes);
  });
  target.sync();
  ++copied.blobs;
  const std::string name = from.filename().string();
  if (to_hex(digest.finish()) != name) copied.damaged.insert(name);
  return true;
}

// Paths of all existing blobs, below their folders.
std::vector<std::string> blobs_of(const fs::path& data) {
  std::vector<std::string> names;
  std::error_code gone;  // folders and files come and go meanwhile
  for (const auto& folder : fs::directory_iterator(data / kBlobs, gone)) {
    if (!folder.is_directory(gone)) continue;
    for (const auto& file : fs::directory_iterator(folder.path(), gone)) {
      if (file.is_regular_file(gone)) {
        names.push_back(folder.path().filename().string() + '/' + file.path().filename().string());
      }
    }
  }
  return names;
}

std::string place_of(const std::string& key) { return key.substr(0, 2) + '/' + key; }

class Copy {
 public:
  Copy(const fs::path& from, const fs::path& to) : from_(from), to_(to) {
    make_folder(to_);
    make_folder(to_ / kBlobs);
  }

  // Returns false if the blob is gone.
  bool take(const std::string& blob) {
    if (taken_.contains(blob)) return true;
    const fs::path target = to_ / kBlobs / blob;
    make_folder(target.parent_path());
    if (!copy_file(from_ / kBlobs / blob, target, copied_)) return false;
    taken_.insert(blob);
    return true;
  }

  void drop_all_but(const std::set<std::string>& wanted) {
    for (auto blob = taken_.begin(); blob != taken_.end();) {
      if (wanted.contains(*blob)) {
        ++blob;
        continue;
      }
      const fs::path file = to_ / kBlobs / *blob;
      --copied_.blobs;
      copied_.damaged.erase(file.filename().string());
      copied_.bytes -= fs::file_size(file);
      fs::remove(file);
      blob = taken_.erase(blob);
    }
  }

  // Syncs the folders, so that the names are on disk too.
  void sync() const {
    for (const auto& folder : fs::directory_iterator(to_ / kBlobs)) {
      if (folder.is_directory()) sync_folder(folder.path());
    }
    sync_folder(to_ / kBlobs);
    sync_folder(to_);
  }

  const Amount& copied() const { return copied_; }

 private:
  const fs::path from_;
  const fs::path to_;
  std::set<std::string> taken_;
  Amount copied_;
};

// Writes a consistent snapshot of the records.
void snapshot(const fs::path& data, const fs::path& file) {
  std::error_code absent;
  fs::remove(file, absent);
  File::create(file);  // with the access rights of records
  Connection connection(data / kRecords, Connection::Mode::kRead);
  connection.run("VACUUM INTO ?", file.string());
  File::open(file).sync();
}

// A column whose values are the keys of blobs, and the column that says in messages what needs
// them.
std::set<std::string> named_blobs(const fs::path& records) {
  Connection connection(records, Connection::Mode::kRead);
  std::set<std::string> blobs;
  Rows query = connection.query("SELECT DISTINCT blob FROM named_blobs WHERE blob IS NOT NULL");
  while (query.next()) blobs.insert(place_of(query.text(0)));
  return blobs;
}

// Describes lost blobs by the records that need them.
std::vector<std::string> told(const fs::path& records, const std::set<std::string>& keys) {
  Connection connection(records, Connection::Mode::kRead);
  std::vector<std::string> lost;
  for (const std::string& key : keys) {
    Rows query = connection.query("SELECT what, name FROM named_blobs WHERE blob = ?1", key);
    while (query.next()) lost.push_back(query.text(0) + query.text(1));
  }
  return lost;
}

Copied described(const Amount& amount, const std::set<std::string>& missing_places,
                 const fs::path& records) {
  std::set<std::string> missing;
  for (const std::string& place : missing_places)
    missing.insert(fs::path(place).filename().string());
  return {.blobs = amount.blobs,
          .bytes = amount.bytes,
          .damaged = told(records, amount.damaged),
          .missing = told(records, missing)};
}

// Writes the mark by which Identity knows that the blobs belong to these records. That is true for
// the blobs that the records name.
void mark_blobs(const fs::path& folder) {
  Connection connection(folder / kRecords, Connection::Mode::kRead);
  Rows query = connection.query("SELECT id, number FROM identity");
  if (!query.next()) return;
  const std::string text = query.text(0) + ' ' + std::to_string(query.integer(1)) + '\n';
  File file = File::create(folder / kBlobs / kIdentity);
  file.write(std::as_bytes(std::span(text)));
  file.sync();
}

bool is_in(const fs::path& path, const fs::path& folder) {
  const auto whole = [](const fs::path& given) {
    const fs::path found = fs::weakly_canonical(fs::absolute(given));
    return found.has_filename() ? found : found.parent_path();
  };
  const fs::path inner = whole(path);
  const fs::path outer = whole(folder);
  return std::ranges::mismatch(inner, outer).in2 == outer.end();
}

void check_is_data_folder(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_regular_file(folder / kRecords, error) || !fs::is_directory(folder / kBlobs, error)) {
    refuse(folder, "is not a data folder of isomeshd or a backup of one");
  }
}

// Copies the blobs, then the records, then blobs that these name and that were not there before. If
// such a blob is missing, a later state of the records no longer names it, so the records are
// copied again. A blob missing twice was already lost.
Copied copy_consistently(const fs::path& data, const fs::path& target) {
  Copy copy(data, target);
  std::set<std::string> missed_before;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    for (const std::string& blob : blobs_of(data)) copy.take(blob);
    snapshot(data, target / kRecords);
    const std::set<std::string> named = named_blobs(target / kRecords);
    std::set<std::string> missed;
    for (const std::string& blob : named) {
      if (!copy.take(blob)) missed.insert(blob);
    }
    if (!missed.empty() && missed != std::exchange(missed_before, missed)) continue;
    copy.drop_all_but(named);
    mark_blobs(target);
    copy.sync();
    return described(copy.copied(), missed, target / kRecords);
  }
  throw Error(ErrorCode::kUnavailable, "too much changed during the copy: try again");
}

// --- Restore

// `data` is empty.
Copied put_back(const fs::path& backup, const fs::path& data) {
  File::create(data / kUnfinishedRestore).sync();
  sync_folder(data);
  Copy copy(backup, data);
  std::set<std::string> missing;
  for (const std::string& blob : named_blobs(backup / kRecords)) {
    if (!copy.take(blob)) missing.insert(blob);
  }
  Amount records;
  copy_file(backup / kRecords, data / kRecords, records);
  mark_blobs(data);
  copy.sync();
  fs::remove(data / kUnfinishedRestore);
  sync_folder(data);
  return described(copy.copied(), missing, data / kRecords);
}

void give_to(uid_t user, gid_t group, const fs::path& folder) {
  const auto give = [&](const fs::path& path) {
    if (::lchown(path.c_str(), user, group) != 0) {
      throw Error(ErrorCode::kInternal, path.string() + ": its owner cannot be changed");
    }
  };
  give(folder);
  for (const auto& entry : fs::recursive_directory_iterator(folder)) give(entry.path());
}

}  // namespace

Copied back_up(const fs::path& data, const fs::path& named) {
  check_is_data_folder(data);
  {
    Connection connection(data / kRecords, Connection::Mode::kRead);
    refuse_moved(connection);
  }
  std::error_code error;
  // Shell completion appends a slash to a folder's name.
  const fs::path target = named.has_filename() ? named : named.parent_path();
  if (is_in(target, data)) refuse(target, "is inside the data folder and would be lost with it");
  if (fs::exists(fs::symlink_status(target, error))) refuse(target, "already exists");
  const fs::path part = target.string() + ".part";
  if (fs::exists(fs::symlink_status(part, error))) {
    refuse(
        part,
        "exists: another backup is running, or one was interrupted. Remove it if none is running");
  }
  try {
    const Copied copied = copy_consistently(data, part);
    move_to(part, target);
    sync_folder(fs::absolute(target).parent_path());
    return copied;
  } catch (...) {
    fs::remove_all(part, error);  // report the first error, not this one
    throw;
  }
}

Copied restore(const fs::path& backup, const fs::path& data,
               const std::vector<Schema>& components) {
  check_is_data_folder(backup);
  {
    Connection connection(backup / kRecords, Connection::Mode::kRead);
    check_versions(connection, components);
  }
  if (is_in(data, backup)) refuse(data, "is inside the backup");
  std::error_code error;
  const bool is_there = fs::exists(data, error);
  if (fs::exists(data / kUnfinishedRestore, error)) refuse(data, kRestoreAgain);
  if (is_there && (!fs::is_directory(data, error) || !fs::is_empty(data, error))) {
    refuse(data, "is not empty: a backup is restored into a new folder");
  }
  fs::create_directories(data, error);
  if (error) throw Error(ErrorCode::kInternal, data.string() + ": " + error.message());
  // The lock of DataFolder: a daemon started meanwhile fails.
  const Descriptor lock(::open((data / "lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (lock.number() < 0 || ::flock(lock.number(), LOCK_EX | LOCK_NB) != 0) {
    throw Error(ErrorCode::kUnavailable, "another isomeshd is using " + data.string());
  }
  struct stat owner = {};
  const bool has_owner = is_there && ::stat(data.c_str(), &owner) == 0;
  try {
    const Copied copied = put_back(backup, data);
    if (has_owner && ::geteuid() == 0) give_to(owner.st_uid, owner.st_gid, data);
    return copied;
  } catch (...) {
    // Errors of the removal are ignored; the original one is reported. The lock is removed last:
    // until then no daemon can start there.
    for (const char* made : {kBlobs, kRecords, kUnfinishedRestore, "lock"})
      fs::remove_all(data / made, error);
    if (!is_there) fs::remove(data, error);
    throw;
  }
}

}  // namespace isomesh::store
