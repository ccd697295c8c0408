#pragma once

#include <chrono>
#include <filesystem>
#include <set>
#include <string>

namespace isomesh::store {

// Marks for other daemons, in a shared folder, the blobs that a daemon is storing or has stored and
// not named yet. A hold is an empty file. Thread safe.
//
// To store a blob, a daemon makes a hold and then moves the file to its place. To erase one, it
// moves the file away and then checks for holds; if there is one, it moves the file back. So in any
// order, a file stored under a hold stays. Ages are measured by the clock that sets the times of
// files in this folder, not by the clock of a node.
class FolderHolds {
 public:
  explicit FolderHolds(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Returns the hold's name. Throws Error kOutOfSpace or kInternal.
  std::string hold(const std::string& key);

  void let_go(const std::string& name);

  // The held blobs. Older holds are ignored: their daemon has died. Throws Error kInternal if the
  // folder cannot be read.
  std::set<std::string> held(std::chrono::nanoseconds oldest) const;

  // Removes holds older than that.
  void forget(std::chrono::nanoseconds oldest);

 private:
  std::filesystem::path folder_;
};

}  // namespace isomesh::store
