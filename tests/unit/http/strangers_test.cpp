// Who is greedy, thinks long or goes away costs the others nothing.
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/niceness.h"
#include "tests/unit/http/connections_fixture.h"

namespace isomesh::http::fixture {
namespace {

using StrangersTest = ConnectionsTest;

constexpr const char* kStranger = "127.0.0.2";

TEST_F(StrangersTest, WhoeverTakesItsShareIsRefusedMoreAndKeepsWhatItHas) {
  ConnectionOptions few = options();
  few.connections = 16;
  open(few);
  hang_on(8, request("GET", "/words"), kStranger);
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 8; }));
  const Answer refused = get("/status", kStranger);
  EXPECT_EQ(refused.status, 503);
  EXPECT_FALSE(refused.header("retry-after").empty());
  EXPECT_EQ(get("/status").status, 200);
  said_ = 1;
  connections_->wake_sources();
  for (const Connection& stream : clients_) {
    std::string heard;
    while (!heard.ends_with("word\n")) heard += stream.receive_some();
  }
}

TEST_F(StrangersTest, SilentStrangersTakeNobodysPlace) {
  ConnectionOptions few = options();
  few.connections = 16;
  open(few);
  const Connection slow(url_);
  slow.send("GET /status HTTP/1.1\r\n");
  ASSERT_TRUE(eventually([&] { return connections_->pending() == 1; }));
  hang_on(100, "", kStranger);
  hang_on(100, "GET /sta", kStranger);
  EXPECT_EQ(get("/status").status, 200);
  slow.send("Host: a\r\n\r\n");
  EXPECT_EQ(slow.receive().body, "ok");
}

// Bad requests get an error and lingering connections are closed, while other downloads continue.
TEST_F(StrangersTest, BadRequestsCutNobodysDownload) {
  ConnectionOptions few = options();
  few.connections = 64;
  few.sender.most_parting = 8;
  open(few);
  hang_on(1, request("GET", "/words"));
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 1; }));
  for (int n = 0; n < 200; ++n) {
    const Connection& bad = clients_.emplace_back(url_);
    bad.send("nonsense\r\n\r\n");
    EXPECT_EQ(bad.receive().status, 400) << n;
  }
  EXPECT_LE(connections_->sending(), 9U);
  said_ = 1;
  connections_->wake_sources();
  std::string heard;
  while (!heard.ends_with("word\n")) heard += clients_.front().receive_some();
}

TEST_F(StrangersTest, HalfBodiesOfAStrangerTakeNobodysMemory) {
  ConnectionOptions little = options();
  little.acceptor.most_bytes = 200'000;
  open(little);
  const Connection slow(url_);
  slow.send("POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 10\r\n\r\nhalf");
  ASSERT_TRUE(eventually([&] { return connections_->pending() == 1; }));
  hang_on(
      10,
      "POST /body HTTP/1.1\r\nHost: a\r\nContent-Length: 60000\r\n\r\n" + std::string(50'000, 'x'),
      kStranger);
  EXPECT_EQ(clients_.front().receive().status, 0);
  slow.send("there.");
  EXPECT_EQ(slow.receive().body, "whole 10");
}

// Half of the threads is what a stranger holds.
TEST_F(StrangersTest, SlowHandlersOfAStrangerLeaveThreads) {
  open(options());
  hang_on(20, request("GET", "/block"), kStranger);
  ASSERT_TRUE(eventually([&] { return busy_.load(); }));
  EXPECT_EQ(get("/status").body, "ok");
  go_.set_value();
}

// Whoever thinks long holds up neither those who receive what is there nor others who think.
TEST_F(StrangersTest, WhatIsComputedHoldsNobodyUp) {
  open(options());
  hang_on(1, request("GET", "/words"));
  hang_on(40, request("GET", "/think"), kStranger);
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 41; }));
  said_ = 1;
  connections_->wake_sources();
  std::string heard;
  while (!heard.ends_with("word\n")) heard += clients_.front().receive_some();
  EXPECT_EQ(get("/think-fast").body, "thought");
  EXPECT_EQ(get("/status").body, "ok");
  thinking_.set_value();
  for (std::size_t n = 1; n < clients_.size(); ++n) {
    EXPECT_EQ(clients_[n].receive().body, "thought");
  }
}

// However much a stranger asks for, another's first turn comes at once.
TEST_F(StrangersTest, WhatAStrangerHasComputedWaitsForTheStrangersOwn) {
  ConnectionOptions few = options();
  few.computing_threads = 4;
  open(few);
  hang_on(20, request("GET", "/compute"), kStranger);
  ASSERT_TRUE(eventually([&] { return runs_ == 2; }));
  const std::string niceness = get("/compute-fast").body;
  EXPECT_EQ(niceness,
            std::to_string(std::min(::getpriority(PRIO_PROCESS, 0) + kComputingNiceness, 19)));
  EXPECT_EQ(get("/status").body, "ok");
  EXPECT_EQ(runs_, 3);
  computing_.set_value();
  for (const Connection& connection : clients_) EXPECT_EQ(connection.receive().body, niceness);
}

TEST_F(StrangersTest, WhatTooManyWaitForIsRefused) {
  ConnectionOptions narrow = options();
  narrow.computing_threads = 2;
  narrow.backlog = 2;
  narrow.sender.linger = 1h;
  open(narrow);
  hang_on(1, request("GET", "/compute"));
  ASSERT_TRUE(eventually([&] { return runs_ == 1; }));
  hang_on(2, request("GET", "/compute"));  // one of them is its share of those that may wait
  EXPECT_TRUE(eventually([&] { return connections_->sending() == 1; }));
  computing_.set_value();
  std::multiset<int> statuses;
  for (const Connection& connection : clients_) statuses.insert(connection.receive().status);
  EXPECT_EQ(statuses, (std::multiset<int>{200, 200, 503}));
}

TEST_F(StrangersTest, WhoeverIsGoneWhileItIsComputedIsLetGo) {
  open(options());
  hang_on(3, request("GET", "/think"));
  ASSERT_TRUE(eventually([&] { return connections_->sending() == 3; }));
  clients_.clear();
  thinking_.set_value();
  EXPECT_TRUE(eventually([&] { return connections_->open_connections() == 0; }));
}

TEST_F(StrangersTest, WaitersAreAnsweredHoweverManyThereAre) {
  ConnectionOptions narrow = options();
  narrow.backlog = 8;
  open(narrow);
  for (int n = 0; n < 200; ++n) {
    hang_on(1, request("GET", "/wait"));
    ASSERT_TRUE(eventually([&] { return runs_ == n + 1; }));
  }
  ended_ = true;
  connections_->job_ended("job");
  for (const Connection& connection : clients_) EXPECT_EQ(connection.receive().body, "waited");
}

TEST_F(StrangersTest, AnAbandonedRequestIsToldOfAndLetGo) {
  open(patient_options());
  hang_on(1, request("GET", "/cancel"));
  ASSERT_TRUE(eventually([&] { return runs_ == 1; }));
  clients_.clear();
  EXPECT_TRUE(eventually([&] { return cancelled_ == 1 && resumed_ == 1; }));
  EXPECT_TRUE(eventually([&] { return connections_->open_connections() == 0; }));
}

TEST_F(StrangersTest, AnAbandonedWaitEnds) {
  open(patient_options());
  hang_on(3, request("GET", "/wait"));
  ASSERT_TRUE(eventually([&] { return runs_ == 3; }));
  clients_.clear();
  EXPECT_TRUE(eventually([&] { return connections_->open_connections() == 0; }));
  EXPECT_EQ(resumed_, 3);
}

}  // namespace
}  // namespace isomesh::http::fixture
