// Tests of the store of received instances on every engine, and of the orders made from them.
#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/clock.h"
#include "base/ids.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using std::chrono::hours;
using testing::ElementsAre;
using testing::IsEmpty;

const ReceivedSeries kSeries = {"BONE", "1.2", "1.3"};

class ReceivedConformance : public test::EngineTest {
 protected:
  std::optional<std::string> add(const std::string& instance, const std::string& blob,
                                 const ReceivedSeries& series = kSeries) {
    return received().add(series, {.instance = instance, .blob = blob, .bytes = 10});
  }
  HeldSeries only_held() {
    const auto held = received().held();
    EXPECT_EQ(held.size(), 1U);
    return held.at(0);
  }
  OrderRecord record() {
    OrderRecord record;
    record.order.id = time_ordered_id();
    record.order.source = {.pacs = "dimse:BONE", .study = "1.2", .series = "1.3"};
    record.order.parameters.lambda = 1;
    record.order.created = timestamp();
    record.work.begun = record.order.created;
    return record;
  }
  ReceivedFate submit(const OrderRecord& record, std::uint32_t instances, Time last = now(),
                      const std::vector<std::string>& contents = {}, std::size_t most_open = 100) {
    return orders().submit_received({.record = record, .idempotency_key = "", .request_digest = ""},
                                    {.rule = "bone",
                                     .study = "1.2",
                                     .series = "1.3",
                                     .instances = instances,
                                     .contents = contents},
                                    last, most_open);
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, ReceivedConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(ReceivedConformance, InstancesAreHeldAndCounted) {
  add("1.3.2", "b");
  add("1.3.1", "a");
  add("9", "c", {"SKIN", "1.2", "1.3"});
  EXPECT_THAT(received().instances(kSeries),
              ElementsAre(ReceivedInstance{"1.3.1", "a", 10}, ReceivedInstance{"1.3.2", "b", 10}));
  const auto held = received().held();
  ASSERT_EQ(held.size(), 2U);
  EXPECT_EQ(held[0].series, kSeries);
  EXPECT_EQ(held[0].held, 2U);
  EXPECT_EQ(held[0].known, 2U);
  EXPECT_EQ(received().held_bytes(), 30U);
}

TEST_P(ReceivedConformance, WhatIsHeldNamesItsBlob) {
  add("1.3.1", "a");
  EXPECT_TRUE(volumes().names("a"));
  received().release(only_held());
  EXPECT_FALSE(volumes().names("a"));
}

TEST_P(ReceivedConformance, TheSameInstanceIsReplaced) {
  EXPECT_EQ(add("1.3.1", "a"), std::nullopt);
  EXPECT_EQ(add("1.3.1", "a"), std::nullopt) << "the same contents";
  EXPECT_EQ(add("1.3.1", "b"), "a");
  EXPECT_THAT(received().instances(kSeries), ElementsAre(ReceivedInstance{"1.3.1", "b", 10}));
  EXPECT_FALSE(volumes().names("a"));
  received().release(only_held());
  EXPECT_EQ(add("1.3.1", "c"), std::nullopt) << "instead of one that is no longer held";
}

TEST_P(ReceivedConformance, SurvivesARestart) {
  add("1.3.1", "a");
  restart();
  EXPECT_EQ(only_held().held, 1U);
}

TEST_P(ReceivedConformance, ReleasedInstancesStayKnown) {
  add("1.3.1", "a");
  add("1.3.2", "b");
  EXPECT_THAT(received().release(only_held()), ElementsAre("a", "b"));
  EXPECT_THAT(received().held(), IsEmpty());
  EXPECT_EQ(received().held_bytes(), 0U);
  add("1.3.3", "c");
  const HeldSeries held = only_held();
  EXPECT_EQ(held.held, 1U);
  EXPECT_EQ(held.known, 3U);
}

TEST_P(ReceivedConformance, NothingIsReleasedWhenMoreHasCome) {
  add("1.3.1", "a");
  HeldSeries held = only_held();
  held.last -= std::chrono::milliseconds(1);
  EXPECT_THAT(received().release(held), IsEmpty());
  EXPECT_EQ(only_held().held, 1U);
}

TEST_P(ReceivedConformance, OnlyWhatIsNotHeldIsForgotten) {
  add("1.3.1", "a");
  EXPECT_EQ(received().forget(now() + hours(1)), 0U);
  received().release(only_held());
  EXPECT_EQ(received().forget(now() - hours(1)), 0U);
  EXPECT_EQ(received().forget(now() + hours(1)), 1U);
  EXPECT_THAT(received().instances(kSeries), IsEmpty());
}

TEST_P(ReceivedConformance, ASeriesGetsOneOrderThatSucceeds) {
  const OrderRecord first = record();
  EXPECT_EQ(submit(first, 9), ReceivedFate::kNew);
  EXPECT_EQ(submit(record(), 9), ReceivedFate::kOpen);
  EXPECT_EQ(submit(record(), 12), ReceivedFate::kOpen);
  ASSERT_TRUE(end(first, OrderState::kSucceeded));
  EXPECT_EQ(submit(record(), 9, now() + hours(1)), ReceivedFate::kDone);
  EXPECT_EQ(submit(record(), 12), ReceivedFate::kNew);
}

TEST_P(ReceivedConformance, OtherContentsGetAnotherOrder) {
  const auto submit_with = [&](const OrderRecord& record,
                               const std::vector<std::string>& contents) {
    return submit(record, 2, now() - hours(1), contents);
  };
  OrderRecord first = record();
  ASSERT_EQ(submit_with(first, {"1.3.1 a", "1.3.2 b"}), ReceivedFate::kNew);
  first.work.contents = {"1.3.1 a", "1.3.2 b"};
  ASSERT_TRUE(end(first, OrderState::kSucceeded));
  EXPECT_EQ(submit_with(record(), {"1.3.1 a", "1.3.2 b"}), ReceivedFate::kDone);
  EXPECT_EQ(submit_with(record(), {"1.3.2 b"}), ReceivedFate::kDone) << "a part sent again";
  EXPECT_EQ(submit_with(record(), {"1.3.2 c"}), ReceivedFate::kNew);
}

TEST_P(ReceivedConformance, AfterAFailureWhatComesLaterGetsAnother) {
  for (const OrderState state : {OrderState::kFailed, OrderState::kCancelled}) {
    OrderRecord order = record();
    ASSERT_EQ(submit(order, 9, now() + hours(1)), ReceivedFate::kNew);
    ASSERT_TRUE(end(order, state));
    EXPECT_EQ(submit(record(), 9, now() - hours(1)), ReceivedFate::kDone);
  }
}

TEST_P(ReceivedConformance, WithoutAPlaceForItASeriesWaits) {
  EXPECT_EQ(submit(record(), 1, now(), {}, 0), ReceivedFate::kOpen);
}

}  // namespace
}  // namespace isomesh::store
