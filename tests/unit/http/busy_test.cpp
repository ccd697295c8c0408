// Tests of requests that wait for threads, and of responses that wait for receivers.
#include <future>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>

#include "server/http/observe/readiness.h"
#include "tests/unit/http/connections_fixture.h"

namespace isomesh::http::fixture {
namespace {

TEST_F(ConnectionsTest, ProbesWaitForNoOtherRequest) {
  ConnectionOptions with_probe = options();
  with_probe.probes = {"/status"};
  open(with_probe);
  hang_on(static_cast<int>(with_probe.threads) + 8, request("GET", "/block"));
  ASSERT_TRUE(eventually([&] { return busy_.load(); }));
  EXPECT_EQ(get("/status").body, "ok");
  EXPECT_EQ(get("/status?verbose").body, "ok");
  go_.set_value();
}

TEST_F(ConnectionsTest, NothingIsMadeForWhoeverHasGone) {
  ASSERT_TRUE(open_with_busy_thread());
  // Both wait for the one thread, in this order.
  for (const char* path : {"/wait", "/compute-fast"}) Connection(url_).send(request("GET", path));
  const auto asked = std::async(std::launch::async, [&] { return get("/status"); });
  go_.set_value();
  EXPECT_TRUE(eventually([&] { return connections_->open_connections() <= 1; }));
  EXPECT_EQ(runs_, 0);
}

// A request that changes something is carried out even if its client has disconnected.
TEST_F(ConnectionsTest, WhatChangesSomethingIsDoneForWhoeverHasGone) {
  ASSERT_TRUE(open_with_busy_thread());
  Connection(url_).send(request("POST", "/do", "x"));
  go_.set_value();
  EXPECT_TRUE(eventually([&] { return runs_ == 1; }));
}

TEST_F(ConnectionsTest, AnswersOfSlowReceiversAreBounded) {
  ConnectionOptions little = options();
  little.most_response_bytes = std::size_t{16} << 20;
  open(little);
  hang_on(4, request("GET", "/large"));
  EXPECT_TRUE(eventually([&] { return get("/status").status == 503; }));
  clients_.clear();
  EXPECT_TRUE(eventually([&] { return get("/status").status == 200; }));
}

TEST(Readiness, TellsWhatACheckFinds) {
  std::string found;
  Readiness readiness([&] { return found; }, {.patience = 60s});
  EXPECT_EQ(readiness.reason(), "");
  found = "the queue is full";
  EXPECT_EQ(readiness.reason(), "the queue is full");
}

TEST(Readiness, AnErrorIsAReasonWithoutItsWords) {
  Readiness readiness([]() -> std::string { throw std::runtime_error("no disk"); },
                      {.patience = 60s});
  EXPECT_EQ(readiness.reason(), "the records or the storage do not respond");
}

TEST(Readiness, DoesNotWaitForACheckThatHangs) {
  std::promise<void> gate;
  Readiness readiness(
      [opened = gate.get_future().share()] {
        opened.wait();
        return std::string();
      },
      {.patience = 20ms, .believed_for = 60s});
  EXPECT_EQ(readiness.reason(), "the records or the storage do not respond");
  EXPECT_EQ(readiness.reason(), "the records or the storage do not respond");
  gate.set_value();
  EXPECT_TRUE(eventually([&] { return readiness.reason().empty(); }));
}

// The first check is quick, the second hangs.
TEST(Readiness, BelievesItsLastAnswerForAWhile) {
  std::promise<void> gate;
  std::atomic<int> checks = 0;
  const auto check = [&, opened = gate.get_future().share()]() -> std::string {
    if (++checks > 1) opened.wait();
    return "the queue is full";
  };
  Readiness readiness(check, {.patience = 20ms, .believed_for = 60s});
  EXPECT_TRUE(eventually([&] { return readiness.reason() == "the queue is full"; }));
  EXPECT_TRUE(eventually([&] { return readiness.reason() == "the queue is full" && checks > 1; }));
  EXPECT_EQ(readiness.reason(), "the queue is full");
  gate.set_value();
}

}  // namespace
}  // namespace isomesh::http::fixture
