// A daemon that dies and comes back on one data folder.
#pragma once

#include <csignal>
#include <functional>
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

  // A job of so many passes as it is when it has begun to smooth, or has ended before that was
  // seen.
  Job begun_job(int passes, double iso = 50) {
    const std::string id =
        submit(daemon(), upload(daemon(), rough_upload()), iso, slow_smoothing(passes)).id;
    Job seen;
    const bool is_begun = eventually([&] {
      seen = job(id);
      return seen.stage == Stage::kSmooth || is_final(seen.state);
    });
    if (!is_begun) throw std::runtime_error(to_json(seen));
    return seen;
  }

  // One that runs for longer than any test waits for.
  Job endless_job() {
    const Job begun = begun_job(1000);
    if (begun.state != JobState::kRunning) throw std::runtime_error(to_json(begun));
    return begun;
  }

  // Calls attempt(passes) with ever longer jobs until it is true. How long a job takes on a busy
  // machine is not known, and one that ends too soon shows nothing.
  static bool with_a_job_that_is_long_enough(const std::function<bool(int passes)>& attempt) {
    for (int passes = 12; passes <= 1000; passes *= 2) {
      if (attempt(passes)) return true;
    }
    return false;
  }

  static constexpr const char* kJobProgram = "isomesh-job";

  // The processes that the daemon makes meshes in.
  std::set<pid_t> job_processes() {
    std::set<pid_t> found = children_of(daemon().pid());
    std::erase_if(found, [](pid_t process) { return program_of(process) != kJobProgram; });
    return found;
  }

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
