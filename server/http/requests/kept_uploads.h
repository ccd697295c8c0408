// Uploads kept for a limited time: incomplete resumable uploads, and rejected ones that their
// client asked to keep until a person has selected what to read.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "base/mutex.h"
#include "server/http/requests/partial_upload.h"
#include "server/http/requests/upload.h"

namespace isomesh::http {

struct KeptLimits {
  std::chrono::milliseconds time = std::chrono::minutes(15);  // since its last use
  // Per owner, and in total. Beyond that the least recently used one is deleted.
  std::size_t each = 2;
  std::size_t all = 16;

  // For resumable uploads: how long one waits for its next part, the number of those that are not
  // complete and, apart from them, of those that have become volumes, and their total size. Beyond
  // that, the least recently used idle one of the owner with the most is deleted.
  std::chrono::milliseconds part_time = std::chrono::hours(1);
  std::size_t parts = 64;
  std::uint64_t part_bytes = std::uint64_t{16} << 30;
};

// Thread safe. Files are deleted after their last reader. Resumable uploads survive the process, in
// `folder`.
class KeptUploads {
 public:
  using Kept = std::shared_ptr<const ReceivedBody>;
  using Partial = std::shared_ptr<PartialUpload>;
  using Clock = std::chrono::steady_clock;

  // Loads the uploads of an earlier process from the folder, which is created on demand; ""
  // disables resumable uploads.
  explicit KeptUploads(const KeptLimits& limits = {}, std::filesystem::path folder = {},
                       std::function<Clock::time_point()> now = Clock::now);

  const KeptLimits& limits() const { return limits_; }

  // Returns the name of the upload for its owner.
  std::string keep(const std::string& owner, Kept upload) ISOMESH_EXCLUDES(mutex_);

  // Throws Error kGone if there is none of that name, if it belongs to another owner, or if it has
  // become a volume; kNotReady if it is incomplete.
  Kept find(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // Begins a resumable upload. It is not deleted for lack of room while the caller holds it.
  Partial begin(PartialNote note) ISOMESH_EXCLUDES(mutex_);

  // Throws Error kGone as find does, and for uploads in one request; kCancelled for one that was
  // cancelled lately, so that its client does not send it again.
  Partial find_partial(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // The same, but null for uploads in one request.
  Partial partial_of(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // Call after an upload has become a volume, given as JSON, with these options. Deletes an upload
  // that came in one request. Of a resumable one, keeps only the volume and the options.
  void finish(const std::string& owner, const std::string& name, const std::string& volume,
              const Parameters& read_with) ISOMESH_EXCLUDES(mutex_);

  // A missing one is not an error.
  void let_go(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // Lets a resumable upload go, and cancels what reads it. Returns the ids of the volumes that were
  // stored before; none are stored later. Throws Error kGone for all that is no resumable upload.
  std::vector<std::string> cancel(const std::string& owner, const std::string& name)
      ISOMESH_EXCLUDES(mutex_);

  // Deletes all uploads that no client is sending, for lack of room; and their size.
  void let_all_go() ISOMESH_EXCLUDES(mutex_);
  std::uint64_t idle_bytes() ISOMESH_EXCLUDES(mutex_);

  // Checks for expired uploads; for tests with their own clock.
  void wake() ISOMESH_EXCLUDES(mutex_);

 private:
  struct Entry {
    std::string owner;
    std::string name;
    Kept upload;      // null: resumable
    Partial partial;  // null: in one request
    Clock::time_point until;

    bool is_idle() const { return partial && partial.use_count() == 1; }
    bool may_go() const { return !partial || is_idle(); }
  };
  using Entries = std::list<Entry>;

  void find_left() ISOMESH_EXCLUDES(mutex_);
  Clock::time_point end_of(const Entry& entry) const;
  Entries::iterator look_up(const std::string& owner, const std::string& name)
      ISOMESH_REQUIRES(mutex_);
  // Finds an upload and renews its time. Throws Error kGone if there is none.
  Entries::iterator found(const std::string& owner, const std::string& name)
      ISOMESH_REQUIRES(mutex_);
  void make_room() ISOMESH_REQUIRES(mutex_);
  Entries::iterator next_to_go(const std::function<std::uint64_t(const Entry&)>& weight)
      ISOMESH_REQUIRES(mutex_);
  void erase(Entries::iterator entry) ISOMESH_REQUIRES(mutex_);
  void run(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);

  const KeptLimits limits_;
  const std::filesystem::path folder_;
  const std::function<Clock::time_point()> now_;
  Mutex mutex_;
  Condition changed_;
  bool is_woken_ ISOMESH_GUARDED_BY(mutex_) = false;
  Entries kept_ ISOMESH_GUARDED_BY(mutex_);  // the next to be deleted first
  // Owners and names, the oldest first.
  std::deque<std::pair<std::string, std::string>> cancelled_ ISOMESH_GUARDED_BY(mutex_);
  std::jthread thread_;  // last, because it uses the other members
};

}  // namespace isomesh::http
