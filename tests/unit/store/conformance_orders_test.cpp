// Tests of the order store and the audit trail on every engine.
#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>

#include "base/clock.h"
#include "base/ids.h"
#include "tests/support/errors.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using std::chrono::hours;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using Kind = OrderSubmission::Kind;

constexpr std::size_t kMany = 100;

class OrderConformance : public test::EngineTest {
 protected:
  static OrderSpec spec(const std::string& owner = "", const std::string& key = "") {
    OrderSpec spec;
    spec.record.owner = owner;
    spec.record.order.id = time_ordered_id();
    spec.record.order.rule = "bone";
    spec.record.order.source = {.pacs = "main", .study = "1.2", .series = "1.3"};
    spec.record.order.parameters.lambda = 1;
    spec.record.order.created = timestamp();
    spec.record.work.begun = spec.record.order.created;
    spec.idempotency_key = key;
    spec.request_digest = "d";
    return spec;
  }
  OrderRecord submitted(const std::string& owner = "") {
    const OrderSpec made = spec(owner);
    EXPECT_EQ(orders().submit(made, kMany).kind, Kind::kNew);
    return made.record;
  }
  std::vector<std::string> due(Time now) {
    std::vector<std::string> ids;
    for (const OrderRecord& record : orders().due(now, kMany)) ids.push_back(record.order.id);
    return ids;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, OrderConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

// They were postponed while the clock was ahead.
TEST_P(OrderConformance, AreHeldUpByNoClockThatWasSetBack) {
  const OrderRecord record = submitted();
  EXPECT_TRUE(orders().save(record, now() + hours(1)));
  EXPECT_THAT(due(now()), IsEmpty());
  EXPECT_TRUE(orders().save(record, now() + std::chrono::days(40)));
  EXPECT_THAT(due(now()), ElementsAre(record.order.id));
  EXPECT_TRUE(orders().if_due(record.order.id, now()));
}

TEST_P(OrderConformance, AreDueAtOnceAndKept) {
  const OrderRecord record = submitted();
  restart();
  EXPECT_EQ(orders().get(std::nullopt, record.order.id), record.order);
  EXPECT_THAT(due(now()), ElementsAre(record.order.id));
  EXPECT_EQ(orders().if_due(record.order.id, now())->work, record.work);
}

TEST_P(OrderConformance, BelongToTheirOwner) {
  const OrderRecord record = submitted("a");
  EXPECT_EQ(orders().get("a", record.order.id), record.order);
  for (const auto& act :
       std::vector<std::function<void()>>{[&] { orders().get("b", record.order.id); },
                                          [&] { orders().cancel("b", record.order.id); },
                                          [&] { orders().retry("b", record.order.id); }}) {
    EXPECT_EQ(test::code_thrown_by(act), ErrorCode::kNotFound);
  }
  EXPECT_THAT(orders().list("b", {}, "", kMany), IsEmpty());
  EXPECT_THAT(orders().list("a", {}, "", kMany), ElementsAre(record.order));
}

TEST_P(OrderConformance, TheSameKeyIsTheSameOrder) {
  const OrderSpec first = spec("a", "k");
  EXPECT_EQ(orders().submit(first, kMany).kind, Kind::kNew);
  const OrderSubmission again = orders().submit(spec("a", "k"), kMany);
  EXPECT_EQ(again.kind, Kind::kExisting);
  EXPECT_EQ(again.order, first.record.order);
  OrderSpec other = spec("a", "k");
  other.request_digest = "e";
  EXPECT_EQ(orders().submit(other, kMany).kind, Kind::kConflict);
  EXPECT_EQ(orders().submit(spec("b", "k"), kMany).kind, Kind::kNew);
}

TEST_P(OrderConformance, NoMoreThanSoManyAreOpen) {
  const OrderRecord record = submitted();
  EXPECT_EQ(orders().submit(spec(), 1).kind, Kind::kBusy);
  end(record, OrderState::kSucceeded);
  EXPECT_EQ(orders().submit(spec(), 1).kind, Kind::kNew);
}

TEST_P(OrderConformance, StepsAreKeptAndPutOff) {
  OrderRecord record = submitted();
  record.order.state = OrderState::kSending;
  record.work.identity.emplace().patient_id = "P";
  const Time later = now() + hours(1);
  EXPECT_TRUE(orders().save(record, later));
  restart();
  EXPECT_THAT(due(now()), IsEmpty());
  EXPECT_FALSE(orders().if_due(record.order.id, now()));
  ASSERT_TRUE(orders().next_after(now()));
  EXPECT_LT(std::chrono::abs(*orders().next_after(now()) - later), seconds(1));
  EXPECT_EQ(orders().if_due(record.order.id, later + seconds(1))->work, record.work);
  orders().hurry(record.order.id);
  EXPECT_THAT(due(now()), ElementsAre(record.order.id));
}

// Whoever works on a cancelled order finds that out when it saves.
TEST_P(OrderConformance, ThatHaveEndedStayAsTheyAre) {
  OrderRecord record = submitted();
  EXPECT_EQ(orders().cancel("", record.order.id).order.state, OrderState::kCancelled);
  record.order.state = OrderState::kFetching;
  EXPECT_FALSE(orders().save(record, now()));
  EXPECT_FALSE(end(record, OrderState::kSucceeded));
  EXPECT_EQ(orders().cancel("", record.order.id).order.state, OrderState::kCancelled);
  EXPECT_THAT(due(now() + hours(1)), IsEmpty());
  EXPECT_FALSE(orders().next_after(now()));
}

TEST_P(OrderConformance, OnlyWhatFailedIsTriedAnew) {
  OrderRecord record = submitted();
  EXPECT_EQ(test::code_thrown_by([&] { orders().retry("", record.order.id); }),
            ErrorCode::kNotReady);
  record.order.attempts = 4;
  record.order.volume = "v";
  record.order.job = "j";
  record.work.label = "Bone";
  record.work.listed = {"1.4"};
  record.work.callback = "https://a.example/";
  EXPECT_TRUE(end(record, OrderState::kFailed));
  const Order again = orders().retry("", record.order.id);
  EXPECT_EQ(again.state, OrderState::kWaiting);
  EXPECT_EQ(again.attempts, 0U);
  EXPECT_FALSE(again.job || again.volume || again.finished || again.error);
  const auto work = orders().if_due(record.order.id, now());
  ASSERT_TRUE(work);
  EXPECT_THAT(work->work.listed, IsEmpty());
  EXPECT_EQ(work->work.label, "Bone");
  EXPECT_EQ(work->work.callback, record.work.callback);
}

// The sweeper would take an object that is about to be sent.
TEST_P(OrderConformance, ADamagedRecordHidesAndBlocksNoOther) {
  const OrderRecord damaged = submitted();
  const OrderRecord next = submitted();
  damage("orders", damaged.order.id);
  EXPECT_EQ(test::code_thrown_by([&] { orders().get(std::nullopt, damaged.order.id); }),
            ErrorCode::kInternal);
  const std::vector<Order> listed = orders().list(std::nullopt, {}, "", 1);
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_EQ(listed[0].id, next.order.id);
  EXPECT_THAT(orders().list(std::nullopt, {}, next.order.id, 1), IsEmpty());
  EXPECT_THAT(due(now()), testing::UnorderedElementsAre(damaged.order.id, next.order.id));
  auto record = orders().if_due(damaged.order.id, now());
  ASSERT_TRUE(record && record->is_damaged);
  EXPECT_TRUE(end(*record, OrderState::kFailed));
  EXPECT_EQ(orders().get(std::nullopt, damaged.order.id).state, OrderState::kFailed);
  EXPECT_EQ(test::code_thrown_by([&] { orders().retry(std::nullopt, damaged.order.id); }),
            ErrorCode::kNotReady);
}

TEST_P(OrderConformance, ADamagedRecordIsCancelled) {
  for (const bool has_ended : {false, true}) {
    const OrderRecord record = submitted();
    if (has_ended) end(record, OrderState::kFailed);
    damage("orders", record.order.id);
    EXPECT_EQ(orders().cancel(std::nullopt, record.order.id).order.state, OrderState::kCancelled);
    EXPECT_EQ(orders().get(std::nullopt, record.order.id).state, OrderState::kCancelled);
  }
}

TEST_P(OrderConformance, NameTheirObjectsUntilTheyEnd) {
  OrderRecord record = submitted();
  record.work.blobs = {"aa", "aa", "bb"};
  EXPECT_TRUE(orders().save(record, now()));
  EXPECT_TRUE(volumes().names("aa") && volumes().names("bb"));
  record.work.blobs = {"bb"};
  EXPECT_TRUE(orders().save(record, now()));
  EXPECT_FALSE(volumes().names("aa"));
  EXPECT_TRUE(volumes().names("bb"));
  EXPECT_TRUE(end(record, OrderState::kSucceeded));
  EXPECT_FALSE(volumes().names("bb"));
}

TEST_P(OrderConformance, TellTheBlobsThatTheyName) {
  OrderRecord record = submitted();
  EXPECT_THAT(orders().blobs(record.order.id), IsEmpty());
  record.work.blobs = {"b", "a", "b"};
  orders().save(record, now());
  EXPECT_THAT(orders().blobs(record.order.id), testing::UnorderedElementsAre("a", "b"));
  end(record, OrderState::kSucceeded);
  EXPECT_THAT(orders().blobs(record.order.id), IsEmpty());
}

// The caller erases them.
TEST_P(OrderConformance, TellTheBlobsThatTheyNamedUntilTheyWereCancelled) {
  OrderRecord record = submitted();
  record.work.blobs = {"b", "a"};
  orders().save(record, now());
  for (const char* attempt : {"first", "second"}) {
    EXPECT_THAT(orders().cancel(std::nullopt, record.order.id).blobs,
                testing::UnorderedElementsAre("a", "b"))
        << attempt;
  }
  OrderRecord damaged = submitted();
  damaged.work.blobs = {"c"};
  orders().save(damaged, now());
  damage("orders", damaged.order.id);
  EXPECT_THAT(orders().cancel(std::nullopt, damaged.order.id).blobs, ElementsAre("c"));
}

TEST_P(OrderConformance, TheirEndIsToldOnce) {
  OrderRecord record = submitted();
  record.work.callback = "https://a.example/x";
  EXPECT_TRUE(orders().save(record, now()));
  EXPECT_EQ(outbox().count(), 0U);
  EXPECT_TRUE(end(record, OrderState::kSucceeded));
  EXPECT_FALSE(end(record, OrderState::kFailed));
  const auto told = outbox().due(now() + seconds(1), 9);
  ASSERT_EQ(told.size(), 1U);
  EXPECT_EQ(told[0].job, record.order.id);
  EXPECT_THAT(told[0].body, HasSubstr("succeeded"));
  EXPECT_THAT(told[0].body, testing::Not(HasSubstr("\"1.3\"")));
}

// Its first end may still be on its way to the receiver.
TEST_P(OrderConformance, TheEndAfterARetryIsToldToo) {
  OrderRecord record = submitted();
  record.work.callback = "https://a.example/x";
  EXPECT_TRUE(end(record, OrderState::kFailed));
  const auto due = [&] { return outbox().due(now() + seconds(1), 9); };
  const Delivery first = due().at(0);
  orders().retry(std::nullopt, record.order.id);
  EXPECT_TRUE(end(record, OrderState::kSucceeded));
  outbox().postpone(first, now() + hours(1));
  ASSERT_EQ(due().size(), 1U);
  outbox().remove(first);
  const auto second = due();
  ASSERT_EQ(second.size(), 1U);
  EXPECT_THAT(second[0].body, HasSubstr("succeeded"));
  EXPECT_EQ(second[0].attempts, 0);
  outbox().remove(second[0]);
  EXPECT_EQ(outbox().count(), 0U);
}

TEST_P(OrderConformance, AreListedInPages) {
  const OrderRecord first = submitted();
  const OrderRecord second = submitted();
  const OrderRecord third = submitted();
  end(second, OrderState::kFailed);
  const auto ids = [&](const OrderFilter& filter, const std::string& after, std::size_t limit) {
    std::vector<std::string> found;
    for (const Order& order : orders().list("", filter, after, limit)) found.push_back(order.id);
    return found;
  };
  EXPECT_THAT(ids({}, "", 2), ElementsAre(third.order.id, second.order.id));
  EXPECT_THAT(ids({}, second.order.id, 2), ElementsAre(first.order.id));
  EXPECT_THAT(ids({.state = OrderState::kFailed}, "", 9), ElementsAre(second.order.id));
  EXPECT_THAT(ids({.rule = "other"}, "", 9), IsEmpty());
  EXPECT_EQ(ids({.rule = "bone"}, "", 9).size(), 3U);
}

TEST_P(OrderConformance, AWatchOrdersASeriesOnceForEachOfItsLengths) {
  WatchedSeries series = {.rule = "bone", .study = "1.2", .series = "1.3", .instances = 20};
  const OrderSpec first = spec();
  EXPECT_TRUE(orders().submit_watched(first, series, kMany));
  EXPECT_FALSE(orders().submit_watched(spec(), series, kMany));
  series.instances = 30;  // it grows while its order waits for that
  EXPECT_FALSE(orders().submit_watched(spec(), series, kMany));
  OrderRecord record = first.record;
  record.order.source.instances = 30;
  EXPECT_TRUE(end(record, OrderState::kSucceeded));
  restart();
  EXPECT_FALSE(orders().submit_watched(spec(), series, kMany));
  series.instances = 31;
  EXPECT_FALSE(orders().submit_watched(spec(), series, 0)) << "too many are open";
  EXPECT_TRUE(orders().submit_watched(spec(), series, kMany));
  series.rule = "other";
  EXPECT_TRUE(orders().submit_watched(spec(), series, kMany));
}

// Not all PACS tell how many instances a series has. The order knows it at its end.
TEST_P(OrderConformance, AWatchOrdersASeriesOfUnknownLengthOnce) {
  const WatchedSeries series = {.rule = "bone", .study = "1.2", .series = "1.3"};
  const OrderSpec first = spec();
  EXPECT_TRUE(orders().submit_watched(first, series, kMany));
  EXPECT_FALSE(orders().submit_watched(spec(), series, kMany));
  OrderRecord record = first.record;
  record.order.source.instances = 30;
  EXPECT_TRUE(end(record, OrderState::kSucceeded));
  EXPECT_FALSE(orders().submit_watched(spec(), series, kMany));
}

TEST_P(OrderConformance, AreCounted) {
  const OrderRecord first = submitted();
  submitted();
  end(first, OrderState::kFailed);
  const OrderCounts counts = orders().counts();
  EXPECT_EQ(counts.by_state_and_rule.at({OrderState::kFailed, "bone"}), 1U);
  EXPECT_EQ(counts.by_state_and_rule.at({OrderState::kWaiting, "bone"}), 1U);
  EXPECT_TRUE(counts.oldest_open);
}

TEST_P(OrderConformance, AreForgottenAfterTheirEnd) {
  const OrderRecord old = submitted();
  const OrderRecord fresh = submitted();
  const OrderRecord open = submitted();
  end(old, OrderState::kSucceeded, now() - hours(48));
  end(fresh, OrderState::kSucceeded);
  EXPECT_EQ(orders().forget(now() - hours(24), now() - hours(24)), 1U);
  EXPECT_EQ(test::code_thrown_by([&] { orders().get("", old.order.id); }), ErrorCode::kNotFound);
  EXPECT_EQ(orders().get("", fresh.order.id).state, OrderState::kSucceeded);
  EXPECT_EQ(orders().get("", open.order.id).state, OrderState::kWaiting);
}

TEST(AuditRecord, HasThePeerOfARefusedLogin) {
  const std::string record = audit_record({.event = AuditEvent::kAuthenticationFailure,
                                           .success = false,
                                           .peer = "192.0.2.1",
                                           .called = "BONE",
                                           .calling = "CT9",
                                           .unlisted = 7});
  EXPECT_THAT(record, HasSubstr(R"("peer":"192.0.2.1","called":"BONE","calling":"CT9")"));
  EXPECT_THAT(record, HasSubstr(R"("unlisted":7)"));
  EXPECT_EQ(audit_record({.event = AuditEvent::kStart}).find("unlisted"), std::string::npos);
}

TEST(AuditLine, OfAnEmptiedRecordHoldsUpNoOther) {
  EXPECT_EQ(audit_line(7, "then", ""), R"({"id":7,"at":"then",)");
  EXPECT_EQ(audit_line(7, "then", "{}"), R"({"id":7,"at":"then",})");
}

TEST_P(OrderConformance, TheAuditTrailGrowsInOrder) {
  audit().add({.event = AuditEvent::kStart});
  audit().add({.event = AuditEvent::kTransferred,
               .success = false,
               .order = "o",
               .owner = "radiology",
               .peer_name = "main",
               .direction = "out",
               .study = "1.2",
               .instances = 3,
               .patient_id = "P \"1\"\n"});
  restart();
  std::vector<std::string> lines;
  audit().read(0, [&](std::string_view line) { lines.emplace_back(line); });
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_THAT(lines[0], testing::StartsWith(R"({"id":1,"at":")"));
  EXPECT_THAT(lines[0], HasSubstr(R"("event":"110120")"));
  EXPECT_THAT(lines[1], HasSubstr(R"("outcome":"failure","order":"o","owner":"radiology",)"
                                  R"("pacs":"main","direction":"out","study":"1.2",)"
                                  R"("patient_id":"P \"1\"\n","instances":3})"));
  lines.clear();
  audit().read(1, [&](std::string_view line) { lines.emplace_back(line); });
  EXPECT_EQ(lines.size(), 1U);
}

}  // namespace
}  // namespace isomesh::store
