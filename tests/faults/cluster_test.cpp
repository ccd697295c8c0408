// Several daemons on one PostgreSQL and one folder of blobs, of which some die, stand still or only
// answer. ISOMESH_KILL_ROUNDS says how often they are killed, and makes the jobs 200.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "base/sha256.h"
#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/support/postgres.h"

namespace isomesh {
namespace {

using namespace test;
using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

constexpr std::size_t kNodes = 3;
constexpr seconds kLease{2};

// Asks every node until one answers: any may be dead, and so may the database.
template <class Act>
auto insist(const Act& act) {
  const auto deadline = std::chrono::steady_clock::now() + kLongest;
  while (true) {
    try {
      return act();
    } catch (const std::exception&) {
      if (std::chrono::steady_clock::now() >= deadline) throw;
    }
    std::this_thread::sleep_for(milliseconds(20));
  }
}

class Cluster : public testing::Test {
 protected:
  void SetUp() override {
    if (!Postgres::is_here()) GTEST_SKIP() << "PostgreSQL is not installed";
    postgres_ = std::make_unique<Postgres>(Postgres::Disk::kDurable);
    store_ = postgres_->new_place();
    std::filesystem::create_directory(folder_ / "shared");
  }

  // Each has a data folder of its own.
  void start(std::size_t node, const std::vector<std::string>& arguments = {}) {
    const std::filesystem::path data = folder_ / ("node" + std::to_string(node));
    nodes_[node] =
        std::make_unique<Daemon>(data, "127.0.0.1:0",
                                 with({"--store", store_, "--blobs", folder_ / "shared",
                                       "--lease-seconds", std::to_string(kLease.count())},
                                      arguments));
  }
  void start_all() {
    for (std::size_t node = 0; node < kNodes; ++node) start(node, {"--workers", "1"});
  }
  void kill(std::size_t node) { nodes_[node].reset(); }
  Daemon& node(std::size_t node) { return *nodes_[node]; }

  std::string ask(const std::string& sql) { return Postgres::ask(store_, sql); }

  bool comes_to(std::size_t node, const std::string& id, JobState state,
                std::chrono::milliseconds longest = kLongest) {
    const auto deadline = std::chrono::steady_clock::now() + longest;
    while (std::chrono::steady_clock::now() < deadline) {
      if (insist([&] { return job(node, id).state == state; })) return true;
      std::this_thread::sleep_for(milliseconds(20));
    }
    return false;
  }

  Job job(std::size_t node, const std::string& id) { return this->node(node).client().job(id); }
  void cancel(std::size_t node, const std::string& id) {
    insist([&] { return this->node(node).client().cancel(id); });
  }
  Volume upload_to(std::size_t node, const RawUpload& upload) {
    return insist([&] { return test::upload(this->node(node), upload); });
  }

  // The id of a job that one of the nodes has accepted; `number` tells it from all others. The key
  // makes a second try the same job.
  std::string submit_to_one(const Volume& volume, std::size_t number) {
    const std::string body = job_body(volume.id, 60 + 0.1 * static_cast<double>(number));
    return insist([&] {
      const Answer answer =
          node(number % kNodes)
              .send("POST", "/v1/jobs", body, {{"Idempotency-Key", std::to_string(number)}});
      if (answer.status != 202 && answer.status != 200) throw std::runtime_error(answer.body);
      return job_from_json(answer.body).id;
    });
  }

  // A job that runs for longer than anybody waits.
  Job endless_job(std::size_t node) {
    const Volume volume = upload_to(node, rough_upload());
    const double iso = 50 + 0.01 * ++endless_;
    const std::string id =
        insist([&] { return submit(this->node(node), volume, iso, slow_smoothing(1000)).id; });
    if (!comes_to(node, id, JobState::kRunning)) throw std::runtime_error("it does not run");
    return insist([&] { return job(node, id); });
  }

  std::unique_ptr<Postgres> postgres_;
  std::string store_;
  TemporaryFolder folder_;
  std::array<std::unique_ptr<Daemon>, kNodes> nodes_;
  int endless_ = 0;
};

TEST_F(Cluster, AStartThatTheDatabaseRejectsSaysWhyWithoutThePassword) {
  ask("CREATE ROLE guarded LOGIN PASSWORD 'the-right-word'");
  const std::filesystem::path passwords = folder_ / "pgpass";
  write_file(passwords, "*:*:*:*:a-wrong-word\n");
  std::filesystem::permissions(passwords, std::filesystem::perms::owner_read);
  const auto start_on = [&](std::string url) {
    return refused_start(folder_ / "data", {"--store", url + "&passfile=" + passwords.string()});
  };
  const auto url_with = [&](const std::string& part, const std::string& instead) {
    std::string url = store_;
    return url.replace(url.find(part), part.size(), instead);
  };
  const Finished stranger = start_on(url_with("user=isomesh", "user=guarded"));
  EXPECT_EQ(stranger.status, 1);
  EXPECT_THAT(stranger.errors,
              testing::StartsWith("isomeshd: the database of --store cannot be used: "));
  EXPECT_THAT(stranger.errors, HasSubstr("password authentication failed for user \"guarded\""));
  EXPECT_THAT(stranger.errors, testing::Not(HasSubstr("a-wrong-word")));
  const Finished elsewhere = start_on(url_with("/postgres?", "/nowhere?"));
  EXPECT_EQ(elsewhere.status, 1);
  EXPECT_THAT(elsewhere.errors, HasSubstr("database \"nowhere\" does not exist"));
}

TEST_F(Cluster, NothingIsLostOrDoneTwiceWhenNodesAndTheDatabaseDie) {
  const char* asked = std::getenv("ISOMESH_KILL_ROUNDS");
  const int rounds = asked == nullptr ? 3 : std::stoi(asked);
  const int jobs = asked == nullptr ? 24 : 200;
  const unsigned seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  start_all();
  const Volume volume = upload_to(0, sphere_upload());
  std::vector<std::string> accepted;
  const auto submit_some = [&](int count) {
    for (int n = 0; n < count; ++n) {
      accepted.push_back(submit_to_one(volume, accepted.size()));
    }
  };
  for (int round = 0; round < rounds; ++round) {
    submit_some((jobs - static_cast<int>(accepted.size())) / (rounds - round));
    std::this_thread::sleep_for(milliseconds(std::uniform_int_distribution(0, 300)(random)));
    if (round % 3 == 1) {
      postgres_->stop_at_once();
      postgres_->start();
    } else {
      const std::size_t victim = std::uniform_int_distribution<std::size_t>(0, 2)(random);
      kill(victim);
      start(victim, {"--workers", "1"});
    }
  }
  const Daemon reference;
  upload(reference, sphere_upload());
  for (const std::string& id : accepted) {
    const Job job = insist([&] { return node(0).client().wait(id); });
    ASSERT_EQ(job.state, JobState::kSucceeded) << to_json(job);
    EXPECT_EQ(ask("SELECT count(*) FROM events WHERE kind = 2 AND job = '" + id + "'"), "1");
    const MeshFile& file = job.mesh->files.at(MeshFormat::kDrc);
    EXPECT_EQ(sha256_of(node(1).get(file.href).body), file.sha256);
    if (id != accepted.front() && id != accepted.back()) continue;
    const Job right = reference.client().wait(submit(reference, volume, *job.parameters.iso).id);
    EXPECT_EQ(right.mesh->files.at(MeshFormat::kDrc).sha256, file.sha256);
  }
  EXPECT_EQ(ask("SELECT count(*) FROM jobs"), std::to_string(accepted.size()));
  EXPECT_EQ(ask("SELECT count(*) FROM runs"), "0");
  std::cout << rounds << " kills, " << accepted.size() << " jobs, all succeeded once" << std::endl;
}

// Each time the server that takes writes is lost with its disk, and its standby takes its place.
TEST_F(Cluster, AStandbyThatTakesOverHasEveryAcceptedJob) {
  const char* asked = std::getenv("ISOMESH_KILL_ROUNDS");
  const int rounds = asked == nullptr ? 2 : std::stoi(asked);
  constexpr int kJobsOfARound = 12;
  postgres_ = std::make_unique<Postgres>(Postgres::Disk::kReplicated);
  Postgres standby(Postgres::StandbyOf{*postgres_});
  store_ = postgres_->or_on(standby, postgres_->new_place());
  std::array<Postgres*, 2> servers = {postgres_.get(), &standby};
  start_all();
  const Volume volume = upload_to(0, sphere_upload());
  std::vector<std::string> accepted;
  std::mt19937 random(std::random_device{}());
  for (int round = 0; round < rounds; ++round) {
    std::jthread submitter([&] {
      for (int n = 0; n < kJobsOfARound; ++n) {
        accepted.push_back(submit_to_one(volume, accepted.size()));
      }
    });
    std::this_thread::sleep_for(milliseconds(std::uniform_int_distribution(0, 200)(random)));
    servers[0]->stop_at_once();
    servers[1]->promote();
    servers[0]->follow(*servers[1]);
    std::swap(servers[0], servers[1]);
  }
  ASSERT_EQ(accepted.size(), static_cast<std::size_t>(rounds * kJobsOfARound));
  for (const std::string& id : accepted) {
    const Job job = insist([&] { return node(0).client().wait(id); });
    EXPECT_EQ(job.state, JobState::kSucceeded) << to_json(job);
  }
  EXPECT_EQ(ask("SELECT count(*) FROM jobs"), std::to_string(accepted.size()));
  std::cout << rounds << " servers lost, " << accepted.size() << " jobs, all succeeded"
            << std::endl;
}

TEST_F(Cluster, WhatIsAskedOfOneNodeIsTrueOfAll) {
  start(0, {"--workers", "0"});  // only answers
  start(1, {"--workers", "1"});
  const Volume volume = upload_to(0, sphere_upload());
  // Who waits at one node is told of the end at another, long before the wait is over.
  const auto began = std::chrono::steady_clock::now();
  const Job made = insist([&] {
    return job_from_json(
        node(0).send("POST", "/v1/jobs", job_body(volume.id, 90), {{"Prefer", "wait=60"}}).body);
  });
  EXPECT_EQ(made.state, JobState::kSucceeded);
  EXPECT_LT(std::chrono::steady_clock::now() - began, seconds(50));
  // By itself it would go on for longer than anybody waits.
  const Job running = endless_job(0);
  cancel(0, running.id);
  EXPECT_TRUE(comes_to(0, running.id, JobState::kCancelled));
  for (const std::size_t each : {0U, 1U}) {
    EXPECT_TRUE(eventually([&] { return node(each).get("/readyz").status == 200; }));
  }
  postgres_->stop_at_once();
  EXPECT_TRUE(eventually([&] { return node(0).get("/readyz").status == 503; }));
  EXPECT_EQ(node(0).get("/livez").status, 200);
  postgres_->start();
  EXPECT_TRUE(eventually([&] { return node(0).get("/readyz").status == 200; }));
}

TEST_F(Cluster, ARunOutlivesAnOutageThatIsLongerThanItsLease) {
  start(0, {"--workers", "1"});
  start(1, {"--workers", "1"});
  const Job running = endless_job(0);
  ask("CHECKPOINT");  // or the claim may be lost with the server
  const std::string fence = ask("SELECT fence FROM runs");
  postgres_->stop_at_once();
  std::this_thread::sleep_for(2 * kLease);
  postgres_->start();
  ASSERT_TRUE(eventually(
      [&] { return ask("SELECT count(*) FROM runs WHERE lease_until > isomesh_now()") == "1"; }));
  EXPECT_EQ(ask("SELECT fence FROM runs"), fence);
  EXPECT_EQ(ask("SELECT count(*) FROM events WHERE state = 1"), "1") << "it was begun once";
  cancel(1, running.id);
  EXPECT_TRUE(comes_to(0, running.id, JobState::kCancelled));
}

TEST_F(Cluster, OneDaemonProcessesOrdersAlsoAfterARestartOfTheDatabase) {
  const std::filesystem::path hospital = folder_ / "hospital.toml";
  write_file(hospital, "[[pacs]]\nname = \"main\"\ndicomweb = \"http://127.0.0.1:9\"\n");
  const auto is_paused = [&](std::size_t node, const std::string& value) {
    const std::string line = "\nisomesh_orders_paused " + value + '\n';
    return eventually(
        [&] { return this->node(node).get("/metrics").body.find(line) != std::string::npos; });
  };
  start(0, {"--workers", "0", "--hospital", hospital});
  postgres_->stop_at_once();
  postgres_->start();
  ASSERT_TRUE(eventually([&] { return node(0).get("/readyz").status == 200; }));
  const Finished second =
      refused_start(folder_ / "second",
                    {"--store", store_, "--blobs", folder_ / "shared", "--hospital", hospital});
  EXPECT_EQ(second.status, 1);
  EXPECT_THAT(second.errors, HasSubstr("only one daemon may have --hospital"));
  EXPECT_TRUE(is_paused(0, "0"));
  // As if the first had not reached the database for longer than its lease. A statement, so that it
  // cannot renew in between.
  ask("UPDATE tasks SET node = gen_random_uuid(), folder = '', held_until = isomesh_now() + "
      "600000000");
  EXPECT_TRUE(is_paused(0, "1"));
  EXPECT_TRUE(eventually([&] { return node(0).get("/readyz").status == 200; }));
  ask("DELETE FROM tasks");
  EXPECT_TRUE(is_paused(0, "0"));
}

// A server that takes connections and answers nothing, whatever the URL says of time.
TEST_F(Cluster, ADatabaseThatStandsStillIsToldAfterFiveSeconds) {
  store_ += (store_.find('?') == std::string::npos ? "?" : "&") + std::string("connect_timeout=60");
  start(0, {"--workers", "0"});
  const Volume volume = upload_to(0, sphere_upload());
  postgres_->stand_still();
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(node(0).get("/v1/volumes/" + volume.id).status, 503);
  EXPECT_EQ(node(0).get("/v1/jobs").status, 503);
  EXPECT_EQ(node(0).get("/readyz").status, 503);
  EXPECT_EQ(node(0).get("/livez").status, 200);
  EXPECT_LT(std::chrono::steady_clock::now() - began, seconds(30));
  postgres_->go_on();
  EXPECT_TRUE(eventually([&] { return node(0).get("/v1/volumes/" + volume.id).status == 200; }));
}

TEST_F(Cluster, ANodeThatStandsStillCannotFinishAndADrainedOneGivesItsJobsBack) {
  start(0, {"--workers", "1"});
  const Job before = endless_job(0);
  start(1, {"--workers", "1", "--drain-seconds", "0"});
  node(0).send_signal(SIGSTOP);
  ASSERT_TRUE(eventually([&] {
    const Job now = insist([&] { return job(1, before.id); });
    return now.state == JobState::kRunning && now.started != before.started;
  }));
  node(0).send_signal(SIGCONT);
  EXPECT_TRUE(
      eventually([&] { return node(0).errors().find("lost its lease") != std::string::npos; }));
  EXPECT_EQ(ask("SELECT attempts FROM jobs WHERE id = '" + before.id + "'"), "1");
  const Job second = insist([&] { return job(1, before.id); });
  EXPECT_EQ(second.state, JobState::kRunning);
  EXPECT_EQ(node(1).stop(), 0);
  // At once, and not when the lease is over.
  EXPECT_TRUE(eventually([&] {
    const Job now = insist([&] { return job(0, before.id); });
    return now.state == JobState::kRunning && now.started != second.started;
  }));
  cancel(0, before.id);
  EXPECT_TRUE(comes_to(0, before.id, JobState::kCancelled));
}

TEST_F(Cluster, AFolderIsMovedWithAllThatItHolds) {
  const std::filesystem::path data = folder_ / "moved";
  Job done;
  Job waiting;
  Volume volume;
  {
    Daemon alone(data, "127.0.0.1:0", {"--workers", "1"});
    done = finished_job(alone);
    volume = alone.client().volumes().at(0);
    long_job(alone);
    waiting = submit(alone, volume, 77);
  }
  const auto move = [&] {
    return run({ISOMESHD, "move", "--to", store_, "--data", data.string()});
  };
  const Finished moved = move();
  EXPECT_EQ(moved.status, 0) << moved.errors;
  EXPECT_THAT(moved.output, HasSubstr("moved 2 volumes, 3 jobs and 0 orders"));
  EXPECT_NE(move().status, 0) << "the database is not empty";
  const std::string backup = folder_ / "backup";
  for (const std::vector<std::string>& old :
       {std::vector<std::string>{"backup", backup}, {"audit"}, {"audit", "--verify"}}) {
    const Finished refused = run(with(with({ISOMESHD}, old), {"--data", data}));
    EXPECT_EQ(refused.status, 1) << old.front();
    EXPECT_THAT(refused.errors, HasSubstr("--store")) << old.front();
  }
  EXPECT_FALSE(std::filesystem::exists(backup));
  nodes_[0] = std::make_unique<Daemon>(
      data, "127.0.0.1:0", std::vector<std::string>{"--store", store_, "--workers", "2"});
  EXPECT_EQ(node(0).client().job(done.id), done);
  EXPECT_EQ(sha256_of(node(0).get(done.mesh->files.at(MeshFormat::kDrc).href).body),
            done.mesh->files.at(MeshFormat::kDrc).sha256);
  EXPECT_EQ(node(0).client().wait(waiting.id).state, JobState::kSucceeded);
  EXPECT_EQ(node(0).client().volumes().size(), 2U);
  const Finished copied = run({ISOMESHD, "backup", (folder_ / "copy").string(), "--store", store_,
                               "--data", data.string()});
  EXPECT_NE(copied.status, 0);
  EXPECT_THAT(copied.errors, HasSubstr("pg_dump"));
}

}  // namespace
}  // namespace isomesh
