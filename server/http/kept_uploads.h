// Uploads that were refused and whose client asked that they stay, until a person has chosen what
// of them to read.
#pragma once

#include <chrono>
#include <cstddef>
#include <list>
#include <memory>
#include <string>
#include <thread>

#include "base/mutex.h"
#include "server/http/upload.h"

namespace isomesh::http {

struct KeptLimits {
  std::chrono::milliseconds time = std::chrono::minutes(15);  // from when one was last asked for
  // Of each owner, and of all: the one that was not asked for the longest gives way.
  std::size_t each = 2;
  std::size_t all = 16;
};

// Thread safe. A file goes with the last one that reads it.
class KeptUploads {
 public:
  using Kept = std::shared_ptr<const Upload>;

  explicit KeptUploads(const KeptLimits& limits = {});

  // Returns the name by which the owner finds it.
  std::string keep(const std::string& owner, Kept upload) ISOMESH_EXCLUDES(mutex_);

  // Throws Error kGone when there is none of that name, or it is another owner's.
  Kept find(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // One that is not there is no error.
  void let_go(const std::string& owner, const std::string& name) ISOMESH_EXCLUDES(mutex_);

  // For want of room.
  void let_all_go() ISOMESH_EXCLUDES(mutex_);

 private:
  using Clock = std::chrono::steady_clock;
  struct Entry {
    std::string owner;
    std::string name;
    Kept upload;
    Clock::time_point until;
  };

  void run(const std::stop_token& stop) ISOMESH_EXCLUDES(mutex_);

  const KeptLimits limits_;
  Mutex mutex_;
  Condition changed_;
  std::list<Entry> kept_ ISOMESH_GUARDED_BY(mutex_);  // the one that goes first in front
  std::jthread thread_;                               // the last member: it uses the others
};

}  // namespace isomesh::http
