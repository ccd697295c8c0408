// Tests of orders whose steps fail: how long they wait, what they report, and when they give up.
#include "proto/error.h"
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

TEST_F(OrdersTest, OfAStudyOfAnotherPatientWaitLongerEachTime) {
  main_->is_merged = true;
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  fails_with_growing_pauses(id, 6);
  ASSERT_TRUE(until([&] { return get(id).attempts == 7; }));
  EXPECT_EQ(main_->fetches, 7);
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:series-incomplete");
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("another Patient ID"));
  EXPECT_EQ(main_->stores, 0);
  main_->is_merged = false;
  pass(hours(1));
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(get(id).attempts, 7U);
  EXPECT_FALSE(get(id).error);
}

TEST_F(OrdersTest, OfAPacsThatAsksForMonthsWaitAWeek) {
  stop();
  settings_.give_up = hours(24 * 300);
  begin();
  main_->retry_after = static_cast<int>(seconds(hours(24 * 100)).count());
  main_->is_down = true;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).attempts > 0; }));
  EXPECT_LE(time_of(get(id).next_attempt.value()), now() + store::kLongestWait);
  EXPECT_TRUE(store_.due(now(), 1).empty());
  pass(store::kLongestWait);
  EXPECT_TRUE(until([&] { return get(id).attempts == 2; }));
}

TEST_F(OrdersTest, ThatSettleForMonthsAreDueAfterAWeek) {
  stop();
  settings_.settle = hours(24 * 100);
  settings_.poll = hours(24 * 100);
  begin();
  submit();
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  EXPECT_TRUE(until([&] { return store_.due(now(), 1).empty(); }));
  const int calls = main_->calls;
  pass(store::kLongestWait);
  EXPECT_TRUE(until([&] { return main_->calls > calls; }));
}

TEST_F(OrdersTest, OfASeriesOfTwoPatientsFailAtOnce) {
  main_->foreign_slice = kSlices - 1;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return is_final(get(id).state) || get(id).job; }));
  const Order order = get(id);
  ASSERT_EQ(order.state, OrderState::kFailed);
  EXPECT_EQ(order.error->type, "urn:isomesh:problem:unusable-volume");
  EXPECT_THAT(order.error->detail, testing::HasSubstr("different patients"));
  EXPECT_EQ(main_->fetches, 1);
}

TEST_F(OrdersTest, WithADamagedRecordFailAndHoldUpNoOther) {
  main_->hangs = true;
  const std::string damaged = submit();
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  stop();
  main_->hangs = false;
  database_.run(store::Change::kRepeatable,
                "UPDATE orders SET record = '#' || substr(record, 2) WHERE id = ?1", damaged);
  begin();
  const std::string next = submit();
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(next, OrderState::kSucceeded));
  ASSERT_TRUE(until([&] { return orders_->list(std::nullopt, {}, "", 10).size() == 2; }));
  EXPECT_EQ(get(damaged).state, OrderState::kFailed);
  EXPECT_THAT(get(damaged).error.value().detail, testing::HasSubstr("damaged"));
}

TEST_F(OrdersTest, OfASeriesWithoutAListedInstanceWaitLongerEachTime) {
  main_->sent_slices = kSlices - 1;
  const std::string id = submit();
  fails_with_growing_pauses(id, 6);
  ASSERT_TRUE(until([&] { return get(id).attempts == 7; }));
  EXPECT_EQ(main_->fetches, 7);
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:series-incomplete");
  main_->sent_slices = kSlices;
  pass(hours(1));
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
}

TEST_F(OrdersTest, WhoseJobIsGoneFetchAgainAfterAPause) {
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  stop();  // or the order might go on before its job is gone
  ASSERT_TRUE(finish_job(1, [&](const std::string& job) {
    const store::Expirable ended = {
        .kind = store::RecordKind::kJob, .owner = "", .id = job, .last_used = {}};
    jobs_.expire(std::span(&ended, 1), store::kAllBytes);
    begin();
  }));
  ASSERT_TRUE(until([&] { return get(id).attempts == 1; }));
  EXPECT_EQ(get(id).state, OrderState::kWaiting);
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("is gone or damaged"));
  EXPECT_EQ(main_->fetches, 1);
  pass(minutes(1));
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
}

TEST_F(OrdersTest, WhoseVolumeIsDamagedFetchAgainAfterAPause) {
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  const std::string volume = *get(id).volume;
  const std::string samples = volumes_.samples_of(std::nullopt, volume).value();
  test::write_file(blobs_.path_of(samples), "spoilt");
  const auto lease = jobs_.claim("test", minutes(1));
  ASSERT_TRUE(lease);
  store::Outcome outcome;
  outcome.error = to_problem(Error(ErrorCode::kUnusableVolume, "it is damaged"), "");
  ASSERT_TRUE(jobs_.finish(*lease, outcome));
  orders_->job_ended(lease->id);
  ASSERT_TRUE(until([&] { return get(id).attempts == 1; }));
  EXPECT_EQ(get(id).state, OrderState::kWaiting);
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("gone or damaged"));
  pass(minutes(1));
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(get(id).volume, volume);
  EXPECT_TRUE(blobs_.is_intact(samples, {}));
}

TEST_F(OrdersTest, WhoseObjectIsMissingMakeItAgainAfterAPause) {
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  main_->is_down = true;
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return get(id).attempts == 1; }));
  for (const auto& file : test::files_below(data_.blobs())) {
    if (test::read_file(data_.blobs() / file).find("PAT-1") != std::string::npos)
      std::filesystem::remove(data_.blobs() / file);
  }
  main_->is_down = false;
  pass(minutes(1));
  ASSERT_TRUE(until([&] { return get(id).attempts == 2; }));
  EXPECT_EQ(get(id).state, OrderState::kMeshing);
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("made again"));
  pass(minutes(1));
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
}

// Receives an instance with other contents right after somebody has asked for all.
class ReplacingReceived : public store::ReceivedStore {
 public:
  using ReceivedStore::ReceivedStore;

  std::vector<store::ReceivedInstance> instances(
      const store::ReceivedSeries& series) const override {
    auto all = ReceivedStore::instances(series);
    if (const auto act = std::exchange(replace, nullptr)) act();
    return all;
  }

  mutable std::function<void()> replace;
};

TEST_F(OrdersTest, OfReceivedImagesThatAreReplacedWhileTheyAreReadAreIncomplete) {
  ReplacingReceived received(database_);
  const store::ReceivedSeries series = {"BONE", kStudy, kSeries};
  received.add(series, {instance_of(0), "of the first", 1});
  received.replace = [&] { received.add(series, {instance_of(0), "of the second", 1}); };
  Received source("BONE", received, blobs_);
  const auto code_of = [&](const std::string& file) {
    return test::code_thrown_by([&] { source.fetch_series(kStudy, kSeries, folder_ / file, {}); });
  };
  EXPECT_EQ(code_of("first"), ErrorCode::kSeriesIncomplete);
  EXPECT_EQ(code_of("second"), ErrorCode::kUnusableVolume) << "nothing replaces this one";
}

// As if the process died after the PACS had stored the object: nothing is saved from then on.
TEST_F(OrdersTest, HaveTheTransferInTheAuditTrailThoughItsConfirmationIsLost) {
  std::atomic<bool> is_dead = false;
  store_.before_save = [&](const auto&) {
    if (is_dead) throw Error(ErrorCode::kInternal, "the process is dead");
  };
  main_->after_store = [&] {
    is_dead = true;
    main_->is_down = true;
    throw PacsFailure(PacsFault::kUnreachable, "the connection broke");
  };
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return store_.unsaved() > 0; }));
  stop();
  EXPECT_THAT(outcomes_of("110104", id), ElementsAre("success", "failure")) << "in, out";
  is_dead = false;
  main_->is_down = false;
  begin();
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(main_->stores, 1);
  EXPECT_THAT(outcomes_of("110104", id), ElementsAre("success", "failure", "success"));
}

TEST_F(OrdersTest, ThatFindTheObjectOfAnotherOneHaveNoTransferOfIt) {
  for (const bool is_first : {true, false}) {
    const std::string id = submit();
    ASSERT_TRUE(!is_first || finish_job());
    ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
    EXPECT_EQ(outcomes_of("110104", id).size(), is_first ? 2U : 1U);
  }
  EXPECT_EQ(main_->stores, 1);
}

// A PACS may know an object before it lists it.
TEST_F(OrdersTest, SearchAgainForAnObjectThatIsNotListedYet) {
  main_->is_unlisted = true;
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return main_->stores == 1; }));
  for (int look = 0; look < 5; ++look) {
    const int before = main_->calls;
    pass(seconds(1 << look));
    ASSERT_TRUE(until([&] { return main_->calls > before; })) << look;
  }
  stop();  // another process goes on with it
  begin();
  main_->is_unlisted = false;
  pass(seconds(32));
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(get(id).attempts, 0U);
  EXPECT_EQ(main_->stores, 1);
  EXPECT_THAT(outcomes_of("110104", id), ElementsAre("success", "success")) << "in, out";
}

TEST_F(OrdersTest, SendAnObjectAgainThatIsNeverListed) {
  main_->is_unlisted = true;
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return main_->stores == 1; }));
  for (std::uint32_t attempts = 1; attempts <= 2; ++attempts) {
    ASSERT_TRUE(until([&] {
      pass(minutes(1));
      return get(id).attempts >= attempts;
    }));
  }
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("does not find it"));
  EXPECT_EQ(get(id).state, OrderState::kSending);
  EXPECT_GE(main_->stores, 2);
}

// Sixty hours, of which nothing is waited for.
TEST_F(OrdersTest, OutliveAWeekendsOutage) {
  main_->is_down = true;
  const std::string id = submit();
  for (int hour = 0; hour < 60; ++hour) {
    const std::uint32_t before = get(id).attempts;
    pass(hours(1));
    ASSERT_TRUE(until([&] { return get(id).attempts > before; })) << hour;
  }
  const Order waiting = get(id);
  EXPECT_EQ(waiting.state, OrderState::kWaiting);
  EXPECT_EQ(waiting.error->type, "urn:isomesh:problem:pacs-unreachable");
  ASSERT_TRUE(waiting.next_attempt);
  // Pauses grow up to an hour, and are not shorter than half of that.
  EXPECT_LE(waiting.attempts, 135U);
  main_->is_down = false;
  pass(hours(1));
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_FALSE(get(id).error);
  for (const Attempts& attempts : orders_->attempts()) {
    const bool has_failed = attempts.pacs == "main" && attempts.fault == PacsFault::kUnreachable;
    EXPECT_EQ(attempts.count > 0, has_failed) << attempts.pacs << ' ' << to_string(attempts.fault);
  }
}

// A rate needs a first sample.
TEST_F(OrdersTest, FailuresAreCountedFromTheStart) {
  const std::vector<Attempts> all = orders_->attempts();
  for (const PacsFault fault : kPacsFaults) {
    EXPECT_TRUE(std::ranges::any_of(all, [&](const Attempts& each) {
      return each.pacs == "main" && each.fault == fault && each.count == 0;
    })) << to_string(fault);
  }
}

TEST_F(OrdersTest, GiveUpAndAreTriedAnew) {
  main_->is_down = true;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).attempts > 0; }));
  pass(hours(73));
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:pacs-unreachable");
  EXPECT_FALSE(get(id).next_attempt);
  EXPECT_EQ(test::code_thrown_by([&] { orders_->retry("somebody", id); }), ErrorCode::kNotFound);
  main_->is_down = false;
  orders_->retry(std::nullopt, id);
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(test::code_thrown_by([&] { orders_->retry(std::nullopt, id); }), ErrorCode::kNotReady);
}

TEST_F(OrdersTest, WaitAsLongAsThePacsSays) {
  main_->is_down = true;
  main_->retry_after = 1000;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).attempts == 1; }));
  pass(seconds(900));
  ASSERT_TRUE(until([&, passed = now()] { return store_.idle_at() >= passed; }));
  EXPECT_EQ(get(id).attempts, 1U);
  pass(seconds(101));
  EXPECT_TRUE(until([&] { return get(id).attempts == 2; }));
}

}  // namespace
}  // namespace isomesh::orders
