// Orders against a PACS that does as the test says, by a clock that the test sets.
#include "server/orders/orders.h"

#include <atomic>
#include <cstring>
#include <fstream>
#include <map>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "base/sha256.h"
#include "server/orders/received.h"
#include "server/store/sql/audit_trail.h"
#include "server/store/sql/order_store.h"
#include "server/store/sql/received_store.h"
#include "tests/api/dicom_bytes.h"
#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::orders {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;
using test::element;
using testing::ElementsAre;

constexpr const char* kStudy = "1.2.1";
constexpr const char* kSeries = "1.2.2";
constexpr int kSlices = 4;

std::string instance_of(int slice) { return std::string(kSeries) + '.' + std::to_string(slice); }

std::string slice_file(int slice) {
  const std::string pixels(std::size_t{4} * 4 * 2, slice % 2 == 0 ? '\1' : '\0');
  return test::dicom(element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2") +
                     element(8, 0x18, "UI", instance_of(slice)) + element(8, 0x60, "CS", "CT") +
                     element(0x10, 0x20, "LO", "PAT-1") + element(0x20, 0xD, "UI", kStudy) +
                     element(0x20, 0xE, "UI", kSeries) +
                     element(0x20, 0x32, "DS", "0\\0\\" + std::to_string(slice)) +
                     element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0") +
                     element(0x20, 0x52, "UI", "1.9") + test::number(0x28, 2, 1) +
                     element(0x28, 4, "CS", "MONOCHROME2") + test::number(0x28, 0x10, 4) +
                     test::number(0x28, 0x11, 4) + element(0x28, 0x30, "DS", "1\\1") +
                     test::number(0x28, 0x100, 16) + test::number(0x28, 0x101, 16) +
                     test::number(0x28, 0x102, 15) + test::number(0x28, 0x103, 0) +
                     element(0x7FE0, 0x10, "OW", pixels));
}

// One series, and what was stored.
class FakePacs : public Pacs {
 public:
  std::atomic<bool> is_down = false;
  std::atomic<bool> hangs = false;
  std::atomic<int> retry_after = 0;
  std::atomic<int> calls = 0;
  std::atomic<int> stores = 0;

  std::vector<FoundSeries> find_recent(const std::string&, const std::string&,
                                       const std::stop_token&) override {
    return {};
  }
  std::optional<FoundSeries> find_series(const std::string&, const std::string& series,
                                         const std::stop_token& stop) override {
    answer(stop);
    if (series != kSeries) return std::nullopt;
    return FoundSeries{.study = kStudy,
                       .series = kSeries,
                       .modality = "CT",
                       .description = "",
                       .instances = kSlices};
  }
  std::vector<std::string> list_instances(const std::string&, const std::string&,
                                          const std::stop_token& stop) override {
    answer(stop);
    std::vector<std::string> all;
    for (int slice = 0; slice < kSlices; ++slice) all.push_back(instance_of(slice));
    return all;
  }
  std::string fetch_series(const std::string&, const std::string&,
                           const std::filesystem::path& target,
                           const std::stop_token& stop) override {
    answer(stop);
    std::ofstream file(target, std::ios::binary);
    for (int slice = 0; slice < kSlices; ++slice) {
      file << "\r\n--b\r\nContent-Type: application/dicom\r\n\r\n" << slice_file(slice);
    }
    file << "\r\n--b--\r\n";
    return "multipart/related; boundary=b";
  }
  std::optional<std::string> patient_of(const std::string&, const std::stop_token& stop) override {
    answer(stop);
    return "PAT-1";
  }
  std::optional<bool> has_instance(const InstancePlace& place,
                                   const std::stop_token& stop) override {
    answer(stop);
    const Lock lock(mutex_);
    return stored_.contains(place.instance);
  }
  void store(const OutgoingObject& object, const std::stop_token& stop) override {
    answer(stop);
    ++stores;
    const Lock lock(mutex_);
    stored_.insert(object.place.instance);
  }

 private:
  void answer(const std::stop_token& stop) {
    ++calls;
    while (hangs) {
      if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "stopped");
      std::this_thread::sleep_for(milliseconds(2));
    }
    if (is_down) {
      throw PacsFailure(PacsFault::kUnreachable, "it is down", seconds(retry_after.load()));
    }
  }

  Mutex mutex_;
  std::set<std::string> stored_ ISOMESH_GUARDED_BY(mutex_);
};

// Tells until when nothing was due.
class WatchedOrders : public store::SqlOrderStore {
 public:
  using SqlOrderStore::SqlOrderStore;

  std::vector<store::OrderRecord> due(store::Time now, std::size_t limit) const override {
    std::vector<store::OrderRecord> found = SqlOrderStore::due(now, limit);
    if (found.empty()) idle_at_ = std::max(idle_at_.load(), now);
    return found;
  }
  store::Time idle_at() const { return idle_at_; }

 private:
  mutable std::atomic<store::Time> idle_at_ = store::Time();
};

// Counts how often somebody has begun to look at what is held.
class WatchedReceived : public store::SqlReceivedStore {
 public:
  using SqlReceivedStore::SqlReceivedStore;

  std::vector<store::HeldSeries> held() const override {
    ++looks_;
    return SqlReceivedStore::held();
  }
  int looks() const { return looks_; }

 private:
  mutable std::atomic<int> looks_ = 0;
};

class OrdersTest : public test::JobsFixture {
 protected:
  OrdersTest() {
    for (const char* name : {"main", "other"}) {
      PacsSettings settings;
      settings.name = name;
      settings.dicomweb = "http://pacs.example.org";
      hospital_.pacs.push_back(settings);
      auto pacs = std::make_unique<FakePacs>();
      (name == std::string("main") ? main_ : other_) = pacs.get();
      pacs_[name] = std::move(pacs);
    }
    hospital_.settle = seconds(0);
    begin();
  }

  // As a process that goes on after the last one.
  void begin() {
    orders_.reset();
    orders_ = std::make_unique<Orders>(OrderServices{data_, blobs_, volumes_, jobs_, library_,
                                                     labels_, store_, audit_, received_, pacs_},
                                       hospital_,
                                       OrderOptions{.now = [this] { return now(); }, .threads = 3});
    orders_->on_end([](const std::string&) {});
  }

  std::string submit(const std::string& pacs = "main", const std::string& series = kSeries) {
    OrderRequest request;
    request.source = {.pacs = pacs, .study = kStudy, .series = series};
    request.parameters = R"({"iso": 100})";
    request.send = {{.pacs = pacs}};
    return orders_->submit({.name = "", .is_administrator = true}, request, "", "").first.id;
  }

  Order get(const std::string& id) const { return orders_->get(std::nullopt, id); }

  store::Time now() const { return std::chrono::system_clock::now() + ahead_.load(); }

  void pass(milliseconds time) {
    ahead_ = ahead_.load() + time;
    orders_->wake();
  }

  // Waits for what threads of the orders bring about, not for the clock.
  static bool until(const std::function<bool()>& is_so) { return test::eventually(is_so); }
  bool reaches(const std::string& id, OrderState state) {
    return until([&] { return get(id).state == state; });
  }

  std::vector<std::string> outcomes_of_queries(const std::string& order) const {
    std::vector<std::string> outcomes;
    audit_.read(0, [&](std::string_view line) {
      const auto entry = nlohmann::json::parse(line);
      if (entry.at("event") == "110112" && entry.value("order", "") == order) {
        outcomes.push_back(entry.at("outcome"));
      }
    });
    return outcomes;
  }

  // Does what a worker does with the next job: a mesh of so many triangles.
  bool finish_job(std::uint32_t triangles = 1) {
    std::optional<store::Lease> lease;
    if (!until([&] { return (lease = jobs_.claim("test", minutes(1))).has_value(); })) return false;
    last_parameters_ = lease->parameters;
    std::string stl(84 + std::size_t{50} * triangles, '\0');
    stl[80] = 1;
    const auto writer = blobs_.begin();
    writer->write(std::as_bytes(std::span(stl)));
    const store::Blob blob = writer->commit();
    store::Outcome outcome;
    outcome.mesh.emplace().triangles = triangles;
    if (triangles == 0) outcome.mesh->iso = 1000;
    outcome.mesh->files[MeshFormat::kStl] = {.bytes = blob.bytes, .sha256 = blob.key, .href = "/x"};
    const bool is_done = jobs_.finish(*lease, outcome);
    orders_->job_ended(lease->id);
    return is_done;
  }

  std::atomic<milliseconds> ahead_ = milliseconds(0);
  Hospital hospital_;
  PacsByName pacs_;
  FakePacs* main_ = nullptr;
  FakePacs* other_ = nullptr;
  jobs::LabelLists labels_{blobs_};
  WatchedOrders store_{database_};
  store::SqlAuditTrail audit_{database_};
  WatchedReceived received_{database_};
  JobParameters last_parameters_;  // of the job that was finished last
  std::unique_ptr<Orders> orders_;
};

TEST_F(OrdersTest, GoTheirWay) {
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  const Order order = get(id);
  EXPECT_EQ(order.source.instances, 4U);
  ASSERT_EQ(order.results.size(), 1U);
  EXPECT_TRUE(order.results.front().stored);
  EXPECT_EQ(order.attempts, 0U);
  EXPECT_EQ(main_->stores, 1);
  // Whether or not it still lies there, no record keeps the object.
  EXPECT_FALSE(volumes_.names(order.results.front().sop_instance_uid));
}

TEST_F(OrdersTest, TheirFirstQueryIsInTheAuditTrailWithItsOutcome) {
  main_->is_down = true;
  const std::string late = submit();
  for (std::uint32_t attempts = 1; attempts <= 3; ++attempts) {
    ASSERT_TRUE(until([&] { return get(late).attempts == attempts; }));
    pass(minutes(10));
  }
  main_->is_down = false;
  pass(minutes(10));
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(late, OrderState::kSucceeded));
  EXPECT_THAT(outcomes_of_queries(late), ElementsAre("failure"));
  const std::string prompt = submit();
  ASSERT_TRUE(until([&] { return !outcomes_of_queries(prompt).empty(); }));
  EXPECT_THAT(outcomes_of_queries(prompt), ElementsAre("success"));
}

// What the images have is known, and so is why nothing was made of them.
TEST_F(OrdersTest, AnEmptySurfaceIsToldWithTheRangeOfTheSamples) {
  const std::string id = submit();
  ASSERT_TRUE(finish_job(0));
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  EXPECT_EQ(get(id).error->detail,
            "the surface is empty: the iso-value 1000 is outside the samples, which range from 0 "
            "to 257");
}

class FittingOrdersTest : public OrdersTest {
 protected:
  FittingOrdersTest() {
    hospital_.pacs.front().max_send_bytes = 20'000;
    Rule rule;
    rule.name = "fit";
    rule.max_error_mm = 0.5;
    rule.parameters = R"({"iso": 100})";
    rule.send = {{.pacs = "main"}};
    hospital_.rules = {rule};
  }
  std::string submit_by_rule() {
    OrderRequest request;
    request.source = {.pacs = "main", .study = kStudy, .series = kSeries};
    request.rule = "fit";
    return orders_->submit({.name = "", .is_administrator = true}, request, "", "").first.id;
  }
};

TEST_F(FittingOrdersTest, HaveAnotherJobWithinTheError) {
  const std::string id = submit_by_rule();
  ASSERT_TRUE(finish_job(1000));
  EXPECT_FALSE(last_parameters_.triangles);
  ASSERT_TRUE(finish_job(100));
  ASSERT_TRUE(last_parameters_.triangles);
  EXPECT_GT(*last_parameters_.triangles, 200U);
  EXPECT_LT(*last_parameters_.triangles, 400U);
  EXPECT_EQ(last_parameters_.max_error_mm, 0.5);
  EXPECT_TRUE(last_parameters_.certify);
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_LE(get(id).results.front().bytes, 20'000U);
}

TEST_F(FittingOrdersTest, FailWhereTheErrorIsNotEnough) {
  const std::string id = submit_by_rule();
  ASSERT_TRUE(finish_job(1000));
  ASSERT_TRUE(finish_job(900));
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:too-large");
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("max-error-mm"));
}

TEST_F(FittingOrdersTest, WithRoomHaveOneJob) {
  const std::string id = submit_by_rule();
  ASSERT_TRUE(finish_job(100));
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
}

class ReceivedOrdersTest : public OrdersTest {
 protected:
  ReceivedOrdersTest() {
    Rule rule;
    rule.name = "bone";
    rule.parameters = R"({"iso": 100})";
    rule.send = {{.pacs = "main"}};
    hospital_.rules = {rule};
    hospital_.settle = minutes(1);
    hospital_.poll = seconds(1);
    hospital_.dimse.emplace().routes = {{"BONE", "bone"}};
    pacs_[received_by("BONE")] = std::make_unique<Received>("BONE", received_, blobs_);
    begin();
  }
  void receive(int from, int to) {
    for (int slice = from; slice < to; ++slice) {
      const std::string file = slice_file(slice);
      const auto writer = blobs_.begin();
      writer->write(std::as_bytes(std::span(file)));
      const store::Blob blob = writer->commit();
      received_.add({"BONE", kStudy, kSeries}, {instance_of(slice), blob.key, blob.bytes});
      blobs_.settle(blob.key);
    }
  }
  std::vector<Order> all() const { return orders_->list(std::nullopt, {}, "", 10); }
  bool is_held() const { return received_.held_bytes() > 0; }
  // Waits until all that is held was looked at: the second look begins after the first.
  bool is_looked_at() {
    return until([&, before = received_.looks()] { return received_.looks() >= before + 2; });
  }
};

TEST_F(ReceivedOrdersTest, AreMadeWhenNothingMoreComesAndLeaveNothing) {
  receive(0, kSlices);
  ASSERT_TRUE(is_looked_at());
  EXPECT_TRUE(all().empty());
  const std::string blob = received_.instances({"BONE", kStudy, kSeries}).front().blob;
  pass(minutes(2));
  ASSERT_TRUE(finish_job());
  ASSERT_EQ(all().size(), 1U);
  const std::string id = all().front().id;
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(get(id).source.pacs, "dimse:BONE");
  EXPECT_EQ(get(id).source.instances, 4U);
  pass(minutes(1));
  EXPECT_TRUE(until([&] { return !is_held(); }));
  EXPECT_TRUE(until([&] { return !blobs_.size(blob); }));
  // Once more the same, for which there is nothing to do.
  receive(0, kSlices);
  pass(minutes(2));
  EXPECT_TRUE(until([&] { return !is_held(); }));
  EXPECT_EQ(all().size(), 1U);
}

// Whoever was sending could not while nothing listened.
TEST_F(ReceivedOrdersTest, AreNotMadeAtOnceAfterAStart) {
  receive(0, 2);
  orders_.reset();
  ahead_ = hours(1);
  begin();
  ASSERT_TRUE(is_looked_at());
  EXPECT_TRUE(all().empty());
  receive(2, kSlices);
  pass(minutes(2));
  ASSERT_TRUE(finish_job());
  ASSERT_EQ(all().size(), 1U);
  EXPECT_EQ(all().front().source.instances, 4U);
}

TEST_F(ReceivedOrdersTest, WaitForTheRestOfWhatIsNotHeldAnyMore) {
  receive(0, 3);
  pass(minutes(2));
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return is_final(all().front().state); }));
  pass(minutes(1));
  ASSERT_TRUE(until([&] { return !is_held(); }));
  receive(3, kSlices);
  pass(minutes(2));
  ASSERT_TRUE(until([&] { return all().size() == 2 && all().front().attempts > 0; }));
  EXPECT_EQ(all().front().error->type, "urn:isomesh:problem:series-incomplete");
  receive(0, kSlices);
  pass(hours(1));
  ASSERT_TRUE(until([&] {
    pass(minutes(2));
    return all().front().state == OrderState::kMeshing;
  }));
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(all().front().id, OrderState::kSucceeded));
  EXPECT_EQ(all().front().source.instances, 4U);
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
  EXPECT_EQ(orders_->attempts().front().fault, PacsFault::kUnreachable);
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

// One PACS that hangs takes some threads, never all.
TEST_F(OrdersTest, OfOnePacsDoNotHoldUpThoseOfAnother) {
  main_->hangs = true;
  std::vector<std::string> hanging;
  for (int count = 0; count < 8; ++count) hanging.push_back(submit("main"));
  const std::string id = submit("other");
  ASSERT_TRUE(finish_job());
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
  main_->hangs = false;
}

TEST_F(OrdersTest, ThatAreCancelledStopAtOnce) {
  main_->hangs = true;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  EXPECT_EQ(test::code_thrown_by([&] { orders_->cancel("somebody", id); }), ErrorCode::kNotFound);
  EXPECT_EQ(orders_->cancel(std::nullopt, id).state, OrderState::kCancelled);
  EXPECT_EQ(orders_->cancel(std::nullopt, id).state, OrderState::kCancelled);
  main_->hangs = false;
  orders_.reset();  // returns when the step under way is over
  EXPECT_EQ(store_.get(std::nullopt, id).state, OrderState::kCancelled);
}

TEST_F(OrdersTest, CancelTheirJob) {
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  orders_->cancel(std::nullopt, id);
  EXPECT_EQ(jobs_.get(std::nullopt, *get(id).job).state, JobState::kCancelled);
}

TEST_F(OrdersTest, GoOnInAnotherProcessWhereverTheyWere) {
  main_->hangs = true;
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  begin();
  main_->hangs = false;
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  begin();
  main_->is_down = true;
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSending));
  const Order sending = get(id);
  begin();
  main_->is_down = false;
  pass(hours(1));
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
  EXPECT_EQ(get(id).results.front().sop_instance_uid, sending.results.front().sop_instance_uid);
  EXPECT_EQ(main_->stores, 1);
}

// Slices that were not there when it was listed are not meshed as if they did not exist.
TEST_F(OrdersTest, OfASeriesThatIsNotThereFailAfterSomeLooks) {
  const std::string id = submit("main", "1.2.99");
  ASSERT_TRUE(until([&] {
    pass(minutes(10));
    return is_final(get(id).state);
  }));
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:pacs-refused");
}

TEST_F(OrdersTest, NameConfiguredPacsOnly) {
  EXPECT_EQ(test::code_thrown_by([&] { submit("http://evil.example"); }),
            ErrorCode::kInvalidParameter);
}

}  // namespace
}  // namespace isomesh::orders
