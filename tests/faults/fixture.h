// A daemon that dies and comes back on one data folder.
#pragma once

#include <csignal>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include "proto/json.h"
#include "tests/api/daemon.h"

namespace isomesh::test {

class FaultTest : public testing::Test {
 protected:
  void start(const std::vector<std::string>& arguments = {}) {
    daemon_.emplace(folder_ / "data", "127.0.0.1:0", arguments);
  }

  // As the system's out-of-memory killer does it: with SIGKILL, at once.
  void kill() { daemon_.reset(); }

  Daemon& daemon() { return *daemon_; }

  Job job(const std::string& id) { return daemon().client().job(id); }
  Job ended(const std::string& id) { return daemon().client().wait(id); }
  bool comes_to(const std::string& id, JobState state, std::chrono::seconds longest = kLongest) {
    return eventually([&] { return job(id).state == state; }, longest);
  }

  Volume small_volume() { return upload(daemon(), sphere_upload()); }

  std::set<pid_t> job_processes() { return test::job_processes(daemon()); }

  // Runs SQL on the data folder's database; returns the first column of the last row.
  std::string run_sql(const std::string& sql) {
    sqlite3* handle = nullptr;
    std::string answer;
    const auto take = [](void* text, int, char** columns, char**) {
      *static_cast<std::string*>(text) = columns[0] == nullptr ? "" : columns[0];
      return 0;
    };
    sqlite3_open((folder_ / "data/isomesh.sqlite").c_str(), &handle);
    sqlite3_busy_timeout(handle, 10'000);
    EXPECT_EQ(sqlite3_exec(handle, sql.c_str(), take, &answer, nullptr), SQLITE_OK);
    sqlite3_close(handle);
    return answer;
  }

  std::filesystem::path file_of(const std::string& key) {
    return daemon().data() / "blobs" / key.substr(0, 2) / key;
  }

  // Changes one byte in the middle of a blob.
  void spoil(const std::string& key) {
    std::string bytes = read_file(file_of(key));
    bytes[bytes.size() / 2] ^= 1;
    write_file(file_of(key), bytes);
  }

  std::string mesh_of(const Job& job) {
    return daemon().get(job.mesh->files.at(MeshFormat::kDrc).href).body;
  }

  std::size_t blob_count() { return blobs_below(folder_ / "data").size(); }
  std::size_t scratch_count() { return files_below(folder_ / "data/scratch").size(); }

  TemporaryFolder folder_;

 private:
  std::optional<Daemon> daemon_;
};

}  // namespace isomesh::test
