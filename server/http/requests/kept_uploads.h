// Uploads that stay for a while: those that have not come whole yet, and those that were refused
// and whose client asked that they stay, until a person has chosen what of them to read.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <list>
#include <memory>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/http/requests/partial_upload.h"
#include "server/http/requests/upload.h"

namespace isomesh::http {

struct KeptLimits {
  std::chrono::milliseconds time = std::chrono::minutes(15);  // from when one was last asked for
  // Of each owner, and of all: the one that was not asked for the longest gives way.
  std::size_t each = 2;
  std::size_t all = 16;

  // Of uploads that come in parts: how long one waits for the next, and how many there may be and
  // how much they may take together, beside those that somebody sends just now. Then the one that
  // was not asked for the longest of the owner who has most gives way.
  std::chrono::milliseconds part_time = std::chrono::hours(1);
  std::size_t parts = 64;
  std::uint64_t part_bytes = std::uint64_t{16} << 30;
};

// Thread safe. A file goes with the last one that reads it. Uploads that come in parts outlive the
// process, in `folder`.
class KeptUploads {
 public:
  using Kept = std::shared_ptr<const ReceivedBody>;
  using Partial = std::shared_ptr<PartialUpload>;
  using Clock = std::chrono::steady_clock;

  // Finds what an earlier process has left in the folder, which is made when it is needed; "": no
  // upload can come in parts.
  explicit KeptUploads(const KeptLimits& limits = {}, std::filesystem::path folder = {},
                       std::function<Clock::time_point()> now = Clock::now);

  const KeptLimits& limits() const { return limits_; }

  // Returns the name by which the owner finds it.
  std::string keep(const std::string& owner, Kept upload) ISOMESH_EXCLUDES(mutex_);

  // Throws Error kGone when there is none of that name, or it is another owner's, or it has become
  // a volume, and kNotReady when it has not come whole.
  Kept find(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // Begins an upload that comes in parts. Nobody else makes it give way while its caller has it.
  Partial begin(PartialNote note) ISOMESH_EXCLUDES(mutex_);

  // Throws Error kGone as find does, and for one that has come at once.
  Partial find_partial(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // The volume, as JSON, that an upload in parts has become; empty for all others.
  std::string became(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // An upload has been read: one that came at once is let go; of one that came in parts, only what
  // it has become is kept, or all where that are several volumes ("").
  void settle(const std::string& owner, const std::string& name, const std::string& volume)
      ISOMESH_EXCLUDES(mutex_);

  // One that is not there is no error.
  void let_go(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // For want of room: all that nobody reads or sends just now.
  void let_all_go() ISOMESH_EXCLUDES(mutex_);

  // Looks at what is over: for those who set the clock.
  void wake() ISOMESH_EXCLUDES(mutex_);

 private:
  struct Entry {
    std::string owner;
    std::string name;
    Kept upload;      // null: it comes in parts
    Partial partial;  // null: it has come at once
    Clock::time_point until;

    bool is_idle() const { return partial && partial.use_count() == 1; }
  };
  using Entries = std::list<Entry>;

  void find_left() ISOMESH_EXCLUDES(mutex_);
  Clock::time_point end_of(const Entry& entry) const;
  Entries::iterator look_up(const std::string& owner, const std::string& name)
      ISOMESH_REQUIRES(mutex_);
  // The same, and it stays longer. Throws Error kGone where there is none.
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
  Entries kept_ ISOMESH_GUARDED_BY(mutex_);  // the one that goes first in front
  std::jthread thread_;                      // the last member: it uses the others
};

}  // namespace isomesh::http
