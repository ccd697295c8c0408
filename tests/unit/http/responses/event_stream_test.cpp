#include "server/http/responses/event_stream.h"

#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/error.h"
#include "server/http/limits.h"

namespace isomesh::http {
namespace {

using store::EventKind;

store::Event event(std::uint64_t id, EventKind kind, const std::string& job = "a") {
  return {.id = id,
          .owner = "",
          .job = job,
          .kind = kind,
          .state = kind == EventKind::kDone ? JobState::kSucceeded : JobState::kRunning,
          .stage = Stage::kSmooth,
          .progress = 0.5};
}

class EventStreamTest : public testing::Test {
 protected:
  std::unique_ptr<net::Source> source(std::vector<store::Event> past = {}, std::uint64_t last = 0) {
    return event_source({.mailbox = broadcaster_.listen_to("a"),
                         .past = std::move(past),
                         .last = last,
                         .result = [] { return std::string("{\"the\": \"job\"}"); },
                         .place = places_.take("")});
  }

  static std::string told_by(net::Source& source) {
    std::string bytes;
    source.next(bytes);
    if (source.computes()) source.next(bytes);
    return bytes;
  }

  net::FairPlaces places_{2, "streams"};
  Broadcaster broadcaster_;
};

TEST_F(EventStreamTest, TellsThePastAndThenWhatHappens) {
  const auto stream = source({event(1, EventKind::kStage)});
  EXPECT_EQ(told_by(*stream),
            "retry: 2000\n\nid: 1\nevent: stage\n"
            "data: {\"state\":\"running\",\"stage\":\"smooth\",\"progress\":0.5}\n\n");
  std::string nothing;
  EXPECT_EQ(stream->next(nothing), net::Source::More::kLater);
  EXPECT_FALSE(broadcaster_.publish(event(2, EventKind::kProgress, "another job")));
  EXPECT_EQ(stream->next(nothing), net::Source::More::kLater);
  EXPECT_TRUE(broadcaster_.publish(event(3, EventKind::kProgress)));
  broadcaster_.publish(event(4, EventKind::kDone));
  EXPECT_FALSE(stream->computes());
  const std::string rest = told_by(*stream);
  EXPECT_THAT(rest, testing::StartsWith("id: 3\nevent: progress\n"));
  EXPECT_THAT(rest, testing::EndsWith("id: 4\nevent: done\ndata: {\"the\": \"job\"}\n\n"));
  EXPECT_EQ(stream->next(nothing), net::Source::More::kEnd);
}

TEST_F(EventStreamTest, WhatComesTwiceIsToldOnce) {
  const auto stream = source({event(5, EventKind::kStage)}, 4);
  broadcaster_.publish(event(4, EventKind::kStage));
  broadcaster_.publish(event(5, EventKind::kStage));
  broadcaster_.publish(event(6, EventKind::kStage));
  const std::string told = told_by(*stream);
  EXPECT_EQ(told.find("id: 4"), std::string::npos);
  EXPECT_EQ(told.find("id: 5"), told.rfind("id: 5"));
  EXPECT_NE(told.find("id: 6"), std::string::npos);
}

TEST_F(EventStreamTest, OfProgressTheNewestIsKept) {
  const auto stream = source();
  for (std::uint64_t id = 1; id <= 1000; ++id)
    broadcaster_.publish(event(id, EventKind::kProgress));
  const std::string told = told_by(*stream);
  EXPECT_THAT(told, testing::HasSubstr("id: 1000\n"));
  EXPECT_LT(told.size(), 300U);
}

TEST_F(EventStreamTest, OfAJobThatIsGoneEnds) {
  for (const ErrorCode code : {ErrorCode::kNotFound, ErrorCode::kGone}) {
    const auto stream = event_source({.mailbox = broadcaster_.listen_to("a"),
                                      .past = {event(1, EventKind::kStage)},
                                      .result = [&]() -> std::string { throw Error(code, ""); },
                                      .place = places_.take("")});
    broadcaster_.publish(event(2, EventKind::kDone));
    std::string bytes;
    ASSERT_EQ(stream->next(bytes), net::Source::More::kBytes);
    std::string nothing;
    EXPECT_EQ(stream->next(nothing), net::Source::More::kEnd);
    EXPECT_EQ(nothing, "");
  }
}

TEST_F(EventStreamTest, WhoMayNoLongerListenHearsNothing) {
  bool may_listen = true;
  const auto all = event_source(broadcaster_.listen_to_all(std::nullopt), places_.take(""),
                                [&] { return may_listen; });
  const auto one = event_source({.mailbox = broadcaster_.listen_to("a"),
                                 .past = {},
                                 .result = [] { return std::string("{}"); },
                                 .place = places_.take(""),
                                 .may_listen = [&] { return may_listen; }});
  broadcaster_.publish(event(1, EventKind::kStage));
  EXPECT_THAT(told_by(*all), testing::HasSubstr("event: stage"));
  EXPECT_THAT(told_by(*one), testing::HasSubstr("event: stage"));
  may_listen = false;
  broadcaster_.publish(event(2, EventKind::kDone));
  for (net::Source* stream : {all.get(), one.get()}) {
    std::string nothing;
    EXPECT_EQ(stream->next(nothing), net::Source::More::kEnd);
    EXPECT_EQ(nothing, "");
  }
}

TEST_F(EventStreamTest, ListenersThatAreGoneAreForgotten) {
  { const auto stream = source(); }
  broadcaster_.publish(event(1, EventKind::kStage));
  // Its place is free again, too.
  const auto first = source();
  const auto second = source();
  broadcaster_.publish(event(2, EventKind::kStage));
  EXPECT_THAT(told_by(*first), testing::HasSubstr("id: 2\n"));
  EXPECT_THAT(told_by(*second), testing::HasSubstr("id: 2\n"));
}

TEST_F(EventStreamTest, ToAllJobsTellsOfEachThatItsViewerSees) {
  const auto mine = event_source(broadcaster_.listen_to_all("me"), places_.take(""));
  const auto all = event_source(broadcaster_.listen_to_all(std::nullopt), places_.take(""));
  const auto owned = [](std::uint64_t id, EventKind kind, const std::string& job,
                        const std::string& owner) {
    store::Event made = event(id, kind, job);
    made.owner = owner;
    return made;
  };
  EXPECT_TRUE(broadcaster_.publish(owned(1, EventKind::kProgress, "a", "me")));
  broadcaster_.publish(owned(2, EventKind::kStage, "b", "other"));
  // An event of another job in between does not hide newer progress.
  broadcaster_.publish(owned(3, EventKind::kProgress, "a", "me"));
  broadcaster_.publish(owned(4, EventKind::kDone, "a", "me"));
  const std::string progress =
      "event: progress\n"
      "data: {\"id\":\"a\",\"state\":\"running\",\"stage\":\"smooth\",\"progress\":0.5}\n\n";
  const std::string done =
      "event: done\n"
      "data: {\"id\":\"a\",\"state\":\"succeeded\",\"stage\":\"smooth\",\"progress\":0.5}\n\n";
  EXPECT_EQ(told_by(*mine), "retry: 2000\n\n" + progress + done);
  const std::string others = told_by(*all);
  EXPECT_THAT(others, testing::HasSubstr("\"id\":\"b\""));
  EXPECT_THAT(others, testing::HasSubstr(progress + done));
  std::string nothing;
  EXPECT_EQ(mine->next(nothing), net::Source::More::kLater);
}

TEST_F(EventStreamTest, ToAllJobsEndsForWhoDoesNotRead) {
  const auto stream = event_source(broadcaster_.listen_to_all(std::nullopt), places_.take(""));
  for (std::uint64_t id = 1; id <= limits::kMostUnreadEvents + 1; ++id) {
    broadcaster_.publish(event(id, EventKind::kStage, std::to_string(id)));
  }
  std::string bytes;
  EXPECT_EQ(stream->next(bytes), net::Source::More::kEnd);
  EXPECT_EQ(bytes, "");
}

}  // namespace
}  // namespace isomesh::http
