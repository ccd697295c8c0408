#pragma once

#include <chrono>
#include <filesystem>
#include <set>
#include <string>

namespace isomesh::store {

// What several daemons that share a folder of blobs tell each other: which blobs somebody stores,
// or has stored and not named yet. A hold is an empty file. Thread safe.
//
// Who stores a blob makes a hold and then puts the file into its place; who erases one takes the
// file out of its place and then looks for holds, and puts it back where there is one. So whatever
// the order, a file that was put there under a hold stays. Ages are by the clock that gives the
// folder's files their times, never by a node's own.
class FolderHolds {
 public:
  explicit FolderHolds(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Returns the hold's name. Throws Error kOutOfSpace or kInternal.
  std::string hold(const std::string& key) const;

  void let_go(const std::string& name) const;

  // The blobs that are held, but for holds that are older than that: their daemon has died. Throws
  // Error kInternal when the folder cannot be read.
  std::set<std::string> held(std::chrono::nanoseconds oldest) const;

  // Removes holds that are older than that.
  void forget(std::chrono::nanoseconds oldest) const;

 private:
  std::filesystem::file_time_type now() const;

  std::filesystem::path folder_;
};

}  // namespace isomesh::store
