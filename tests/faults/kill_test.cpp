// Clients go on submitting while their daemon is killed again and again. ISOMESH_KILL_ROUNDS says
// how often (tests/kill sets it).
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <sqlite3.h>

#include "base/sha256.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using std::chrono::milliseconds;

constexpr int kClients = 4;
constexpr int kVolumes = 3;

struct Submitted {
  std::string id;
  std::string body;
};

RawUpload ball(int size) {
  return raw_upload(sample<std::uint8_t>(scaled(sphere({8.2, 7.7, 8.1}, 4.0 + 0.4 * size), 12, 100),
                                         {17, 16, 18}));
}

class Kill : public FaultTest {
 protected:
  static int rounds() {
    const char* asked = std::getenv("ISOMESH_KILL_ROUNDS");
    return asked == nullptr ? 8 : std::stoi(asked);
  }

  // The present daemon's address; it changes with every life.
  std::string url() {
    const std::lock_guard lock(mutex_);
    return url_;
  }

  void live() {
    start({"--workers", "2", "--lease-seconds", "30"});
    const std::lock_guard lock(mutex_);
    url_ = daemon().url();
  }

  // True if the response is complete, that is, the daemon lived until its end.
  static bool is_whole(const Answer& answer) {
    const std::string length = answer.header("content-length");
    return answer.status != 0 && !length.empty() && std::stoull(length) == answer.body.size();
  }

  // Until an answer comes: a retry with the same key is what makes it safe.
  Answer insist(const std::string& method, const std::string& target, const std::string& body,
                const Headers& headers) {
    const auto deadline = std::chrono::steady_clock::now() + kLongest;
    while (std::chrono::steady_clock::now() < deadline) {
      try {
        Answer answer = answer_to(url(), request(method, target, body, headers));
        if (is_whole(answer) && answer.status < 500) return answer;
      } catch (const std::runtime_error&) {
        // Nobody listens at the moment.
      }
      std::this_thread::sleep_for(milliseconds(5));
    }
    throw std::runtime_error("no answer to " + method + ' ' + target);
  }

  // One client: uploads a volume of its own now and then, submits, waits, asks again.
  void work(int client) {
    const std::string me = std::to_string(client);
    for (int n = 0; !stop_; ++n) {
      const std::string key = me + '-' + std::to_string(n);
      const RawUpload raw = ball(n / 20 % kVolumes);
      const Answer uploaded = insist("POST", "/v1/volumes?" + raw.query, raw.bytes, {});
      ASSERT_TRUE(uploaded.status == 200 || uploaded.status == 201) << uploaded.body;
      const std::string body = job_body(volume_from_json(uploaded.body).id,
                                        70 + 0.01 * (client + 4 * n), R"("passes": 3)");
      const Headers headers = {{"Idempotency-Key", key}};
      const Answer accepted = insist("POST", "/v1/jobs", body, headers);
      ASSERT_EQ(accepted.status, 202) << accepted.body;
      const std::string id = job_from_json(accepted.body).id;
      {
        const std::lock_guard lock(mutex_);
        submitted_[key] = {id, body};
      }
      if (n % 3 == 0) {
        EXPECT_EQ(job_from_json(insist("POST", "/v1/jobs", body, headers).body).id, id);
      }
      if (n % 2 == 0) insist("GET", "/v1/jobs/" + id + "?wait=1", {}, {});
    }
  }

  // Waits until the job that has waited longest has ended. So that some end also on a slow machine,
  // every second life gets that far.
  void let_the_oldest_end() {
    std::vector<Job> waiting = daemon().client().jobs({.state = JobState::kRunning}).jobs;
    if (waiting.empty()) waiting = daemon().client().jobs({.state = JobState::kQueued}).jobs;
    if (!waiting.empty()) ended(waiting.back().id);
  }

  // Some lives end before they have begun.
  void die_young(milliseconds age) {
    const Process process(
        {ISOMESHD, "--listen", "127.0.0.1:0", "--data", folder_ / "data", "--workers", "2"});
    std::this_thread::sleep_for(age);
  }

  void check_blobs() {
    for (const std::string& file : blobs_below(folder_ / "data")) {
      const std::string name = std::filesystem::path(file).filename();
      EXPECT_EQ(sha256_of(read_file(folder_ / ("data/blobs/" + file))), name);
    }
  }

  // Every job that was accepted has succeeded, once, with the bytes that a daemon gives which is
  // never killed.
  void check_jobs() {
    const Daemon reference;
    for (int size = 0; size < kVolumes; ++size) upload(reference, ball(size));
    for (const auto& [key, one] : submitted_) {
      const Job job = ended(one.id);
      ASSERT_EQ(job.state, JobState::kSucceeded) << to_json(job);
      const Job right =
          job_from_json(reference.send("POST", "/v1/jobs", one.body, {{"Prefer", "wait=30"}}).body);
      ASSERT_EQ(right.state, JobState::kSucceeded);
      const MeshFile& file = job.mesh->files.at(MeshFormat::kDrc);
      EXPECT_EQ(file.sha256, right.mesh->files.at(MeshFormat::kDrc).sha256) << key;
      EXPECT_EQ(sha256_of(mesh_of(job)), file.sha256) << key;
    }
    std::size_t listed = 0;
    std::string cursor;
    do {
      const JobPage page = daemon().client().jobs({}, cursor);
      listed += page.jobs.size();
      cursor = page.next;
    } while (!cursor.empty());
    EXPECT_EQ(listed, submitted_.size());
  }

  std::mutex mutex_;
  std::string url_;                             // guarded by mutex_
  std::map<std::string, Submitted> submitted_;  // by key; guarded by mutex_ while clients work
  std::atomic<bool> stop_ = false;
};

TEST_F(Kill, NothingAcceptedIsLostOrDoneTwice) {
  const unsigned seed = std::random_device()();
  std::mt19937 random(seed);
  SCOPED_TRACE("seed " + std::to_string(seed));
  const auto between = [&](int low, int high) {
    return milliseconds(std::uniform_int_distribution(low, high)(random));
  };
  live();
  {
    std::vector<std::jthread> clients;
    for (int client = 0; client < kClients; ++client) {
      clients.emplace_back([this, client] { work(client); });
    }
    for (int round = 1; round <= rounds(); ++round) {
      if (round % 2 == 0) let_the_oldest_end();
      std::this_thread::sleep_for(between(0, 700));
      kill();
      if (round % 5 == 0) die_young(between(0, 60));
      live();
      if (round % 25 == 0) {
        const std::lock_guard lock(mutex_);
        std::cout << round << " kills, " << submitted_.size() << " jobs" << std::endl;
      }
    }
    stop_ = true;
  }
  ASSERT_FALSE(submitted_.empty());
  check_jobs();
  kill();
  EXPECT_EQ(run_sql("PRAGMA integrity_check"), "ok");
  check_blobs();
  live();
  EXPECT_EQ(scratch_count(), 0U);
  std::cout << rounds() << " kills, " << submitted_.size() << " jobs, all succeeded once"
            << std::endl;
}

}  // namespace
}  // namespace isomesh
