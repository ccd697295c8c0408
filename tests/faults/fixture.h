// A daemon that dies and comes back on one data folder.
#pragma once

#include <csignal>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

  // A job that takes some seconds, and has begun to smooth.
  Job running_job(int passes) {
    const Job begun = submit(daemon(), upload(daemon(), long_upload()), 50,
                             "\"passes\": " + std::to_string(passes));
    if (!eventually([&] { return job(begun.id).stage == Stage::kSmooth; })) {
      throw std::runtime_error(to_json(job(begun.id)));
    }
    return job(begun.id);
  }

  std::string mesh_of(const Job& job) {
    return daemon().get(job.mesh->files.at(MeshFormat::kDrc).href).body;
  }

  std::size_t blob_count() { return files_below(folder_ / "data/blobs").size(); }
  std::size_t scratch_count() { return files_below(folder_ / "data/scratch").size(); }

  TemporaryFolder folder_;

 private:
  std::optional<Daemon> daemon_;
};

}  // namespace isomesh::test
