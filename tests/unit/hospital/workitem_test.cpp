// Orders that perform the workitems of a worklist.
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

using testing::HasSubstr;

// One workitem at a time, by the rules of PS3.4, CC.
class FakeWorklist : public Worklist {
 public:
  std::vector<FoundWorkitem> find_scheduled(const std::stop_token&) override {
    const Lock lock(mutex_);
    return state_ == "SCHEDULED" ? std::vector{item()} : std::vector<FoundWorkitem>();
  }
  std::optional<FoundWorkitem> find_workitem(const std::string& uid,
                                             const std::stop_token&) override {
    const Lock lock(mutex_);
    return uid == uid_ ? std::optional(item()) : std::nullopt;
  }
  bool change_state(const Workitem& item, const std::string& state,
                    const std::stop_token&) override {
    const Lock lock(mutex_);
    const bool is_claim = state == "IN PROGRESS" && state_ == "SCHEDULED";
    const bool is_end = state != "IN PROGRESS" && is_owned_by(item);
    if (is_claim) owner_ = item.transaction;
    if (is_claim || is_end) state_ = state;
    claims_ += is_claim ? 1 : 0;
    lose();
    return is_claim || is_end;
  }
  bool update(const Workitem& item, const std::string& changes, const std::stop_token&) override {
    const Lock lock(mutex_);
    const bool is_owner = is_owned_by(item);
    if (is_owner) last_update_ = changes;
    lose();
    return is_owner;
  }

  // The response to the request of that number from now on is lost; 0 is the next one.
  void schedule(const std::string& uid, int lost = -1) {
    const Lock lock(mutex_);
    uid_ = uid;
    state_ = "SCHEDULED";
    claims_ = 0;
    lost_ = lost;
  }
  void set_state(const std::string& state, const std::string& owner) {
    const Lock lock(mutex_);
    state_ = state;
    owner_ = owner;
  }
  void set_patient(const std::string& patient_id) {
    const Lock lock(mutex_);
    patient_id_ = patient_id;
  }
  std::string state() {
    const Lock lock(mutex_);
    return state_;
  }
  int claims() {
    const Lock lock(mutex_);
    return claims_;
  }
  bool has_lost() {
    const Lock lock(mutex_);
    return lost_ < 0;
  }
  std::string last_update() {
    const Lock lock(mutex_);
    return last_update_;
  }

 private:
  FoundWorkitem item() ISOMESH_REQUIRES(mutex_) {
    return {.uid = uid_,
            .state = state_,
            .readiness = "READY",
            .patient_id = patient_id_,
            .study = kStudy,
            .series = kSeries,
            .procedures = {"READ^99X^Read", "MESH^99X^Mesh"}};
  }
  bool is_owned_by(const Workitem& item) ISOMESH_REQUIRES(mutex_) {
    return item.uid == uid_ && state_ == "IN PROGRESS" && item.transaction == owner_;
  }
  void lose() ISOMESH_REQUIRES(mutex_) {
    if (lost_-- == 0) throw PacsFailure(PacsFault::kUnreachable, "the response was lost");
  }

  Mutex mutex_;
  std::string uid_ ISOMESH_GUARDED_BY(mutex_);
  std::string patient_id_ ISOMESH_GUARDED_BY(mutex_) = "PAT-1";
  std::string state_ ISOMESH_GUARDED_BY(mutex_);
  std::string owner_ ISOMESH_GUARDED_BY(mutex_);
  std::string last_update_ ISOMESH_GUARDED_BY(mutex_);
  int claims_ ISOMESH_GUARDED_BY(mutex_) = 0;
  int lost_ ISOMESH_GUARDED_BY(mutex_) = -1;
};

class WorkitemTest : public OrdersTest {
 protected:
  WorkitemTest() {
    Rule rule;
    rule.name = "mesh";
    rule.worklist = "list";
    rule.procedures = {"MESH^99X"};
    rule.images = "main";
    rule.parameters = R"({"iso": 100})";
    rule.send = {{.pacs = "main"}};
    settings_.rules = {rule};
    peers_["list"].worklist = list_;
  }

  // A process that starts looks at the worklist at once.
  std::string taken() {
    begin();
    if (!until([&] { return !orders_->list(std::nullopt, {}, "", 1).empty(); })) return "";
    return orders_->list(std::nullopt, {}, "", 1).front().id;
  }

  // No time passes for an attempt that is due and has not begun, because orders have a last one.
  bool ends(const std::string& id) {
    return until([&] {
      const Order order = get(id);
      if (order.next_attempt && time_of(*order.next_attempt) > now()) pass(hours(1));
      return is_final(order.state);
    });
  }

  std::shared_ptr<FakeWorklist> list_ = std::make_shared<FakeWorklist>();
};

TEST_F(WorkitemTest, IsPerformedAndNamesItsObject) {
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kSucceeded);
  EXPECT_EQ(list_->state(), "COMPLETED");
  EXPECT_EQ(list_->claims(), 1);
  const auto changes = nlohmann::json::parse(list_->last_update());
  const auto performed = changes.at("00741216").at("Value").at(0);
  const auto output = performed.at("00404033").at("Value").at(0);
  EXPECT_EQ(output.at("00081199").at("Value").at(0).at("00081155").at("Value").at(0),
            get(id).results.front().sop_instance_uid);
  EXPECT_EQ(performed.at("00404019").at("Value").at(0).at("00080100").at("Value").at(0), "MESH");
  EXPECT_THAT(to_json(get(id)), testing::Not(HasSubstr("transaction")));
}

// A code value has 16 bytes here, and the last one is within a character.
TEST_F(WorkitemTest, IsCompletedByAStationWithALongName) {
  settings_.station_name = "Radiologie vor \u00d6hringen";
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kSucceeded);
  const auto changes = nlohmann::json::parse(list_->last_update());
  const auto performed = changes.at("00741216").at("Value").at(0);
  const auto station = performed.at("00404028").at("Value").at(0);
  EXPECT_EQ(station.at("00080100").at("Value").at(0), "Radiologie vor ");
  EXPECT_EQ(station.at("00080104").at("Value").at(0), settings_.station_name);
}

// Each request takes effect, but its response is lost, and another process goes on.
TEST_F(WorkitemTest, IsPerformedOnceWhicheverResponseIsLost) {
  list_->schedule("1.9.0");
  const std::string first = taken();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(ends(first));
  for (int lost = 0;; ++lost) {
    ASSERT_LT(lost, 20);
    list_->schedule("1.9.1" + std::to_string(lost), lost);
    begin();
    ASSERT_TRUE(until([&] {
      return orders_->list(std::nullopt, {}, "", 100).size() == static_cast<std::size_t>(lost) + 2;
    }));
    const std::string id = orders_->list(std::nullopt, {}, "", 1).front().id;
    ASSERT_TRUE(until([&] { return list_->has_lost() || is_final(get(id).state); }));
    const bool was_lost = list_->has_lost();
    begin();
    ASSERT_TRUE(ends(id)) << lost;
    EXPECT_EQ(get(id).state, OrderState::kSucceeded) << lost;
    EXPECT_EQ(list_->state(), "COMPLETED") << lost;
    EXPECT_EQ(list_->claims(), 1) << lost;
    if (!was_lost) break;
  }
  EXPECT_EQ(main_->stores, 1);
}

TEST_F(WorkitemTest, OfAnotherPerformerIsLeftAlone) {
  list_->schedule("1.9.1", 0);  // the order learns of it, and the other one is faster
  const std::string id = taken();
  ASSERT_TRUE(until([&] { return get(id).attempts > 0; }));
  list_->set_state("IN PROGRESS", "another one");
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kFailed);
  EXPECT_THAT(get(id).error->detail, HasSubstr("another performer"));
  EXPECT_EQ(list_->state(), "IN PROGRESS");
  EXPECT_EQ(main_->fetches, 0);
}

TEST_F(WorkitemTest, IsCanceledWithItsOrder) {
  main_->hangs = true;
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(until([&] { return list_->state() == "IN PROGRESS" && main_->calls > 0; }));
  orders_->cancel(std::nullopt, id);
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kCancelled);
  EXPECT_EQ(list_->state(), "CANCELED");
}

TEST_F(WorkitemTest, IsCanceledWhenItsOrderFails) {
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(finish_job(0));
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kFailed);
  EXPECT_THAT(get(id).error->detail, HasSubstr("the surface is empty"));
  EXPECT_EQ(list_->state(), "CANCELED");
  EXPECT_THAT(list_->last_update(), testing::Not(HasSubstr("iso-value")));
}

TEST_F(WorkitemTest, OfAnotherPatientThanItsImagesIsCanceled) {
  list_->set_patient("PAT-2");
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kFailed);
  EXPECT_THAT(get(id).error->detail, HasSubstr("another Patient ID than the workitem"));
  EXPECT_EQ(list_->state(), "CANCELED");
  EXPECT_EQ(main_->stores, 0);
}

TEST_F(WorkitemTest, WithoutAPatientIsPerformed) {
  list_->set_patient("");
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kSucceeded);
}

TEST_F(WorkitemTest, ThatTheWorklistEndsCancelsItsOrder) {
  main_->is_down = true;
  list_->schedule("1.9.1");
  const std::string id = taken();
  ASSERT_TRUE(until([&] { return get(id).attempts > 0; }));
  list_->set_state("CANCELED", "");
  main_->is_down = false;
  ASSERT_TRUE(ends(id));
  EXPECT_EQ(get(id).state, OrderState::kCancelled);
  EXPECT_THAT(get(id).error->detail, HasSubstr("worklist has ended"));
  EXPECT_EQ(main_->stores, 0);
}

}  // namespace
}  // namespace isomesh::orders
