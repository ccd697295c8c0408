// Tests that orders leave no files of patients.
#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

// An order whose object, with the patient's name, is about to be sent.
class SendingOrdersTest : public OrdersTest {
 protected:
  void wait_for_mesh() {
    id_ = submit();
    ASSERT_TRUE(until([&] { return get(id_).job.has_value(); }));
  }
  void go_on_to_send() {
    main_->is_down = true;
    ASSERT_TRUE(finish_job());
    ASSERT_TRUE(until([&] { return get(id_).attempts == 1; }));
    const std::vector<std::string> objects = store_.blobs(id_);
    ASSERT_EQ(objects.size(), 1U);
    object_ = objects[0];
    ASSERT_TRUE(blobs_.size(object_));
  }
  void make_object() {
    ASSERT_NO_FATAL_FAILURE(wait_for_mesh());
    ASSERT_NO_FATAL_FAILURE(go_on_to_send());
  }
  bool is_erased() {
    return until([&] { return !blobs_.size(object_); }) &&
           test::files_below(folder_ / "data/quarantine").empty();
  }

  std::string id_;
  std::string object_;
};

TEST_F(SendingOrdersTest, LeaveNoObjectWhenTheySucceed) {
  make_object();
  main_->is_down = false;
  pass(hours(1));
  ASSERT_TRUE(reaches(id_, OrderState::kSucceeded));
  EXPECT_TRUE(is_erased());
}

TEST_F(SendingOrdersTest, LeaveNoObjectWhenTheyAreCancelled) {
  make_object();
  orders_->cancel(std::nullopt, id_);
  EXPECT_TRUE(is_erased());
}

TEST_F(SendingOrdersTest, LeaveNoObjectThatIsMadeJustBeforeTheyAreCancelled) {
  wait_for_mesh();
  store_.before_cancel = [this] { go_on_to_send(); };
  orders_->cancel(std::nullopt, id_);
  EXPECT_FALSE(blobs_.size(object_));
}

TEST_F(SendingOrdersTest, LeaveAnObjectThatSomethingElseNames) {
  make_object();
  received_.add({"BONE", kStudy, kSeries}, {"1.2.3", object_, 1});
  orders_->cancel(std::nullopt, id_);
  EXPECT_TRUE(blobs_.size(object_));
}

// An order that ends before its objects are named.
class EndingOrdersTest : public OrdersTest {
 protected:
  std::vector<std::string> files_of_patient() {
    stop();
    std::vector<std::string> found;
    for (const auto& folder : {data_.blobs(), folder_ / "data/quarantine"}) {
      for (const auto& file : test::files_below(folder)) {
        if (test::read_file(folder / file).find("PAT-1") != std::string::npos)
          found.push_back(file);
      }
    }
    return found;
  }
};

TEST_F(EndingOrdersTest, LeaveNoObjectIfAnotherOneIsTooLarge) {
  settings_.pacs.front().max_send_bytes = 20'000;
  bytes_of_obj_ = 30'000;
  OrderRequest request;
  request.source = {.pacs = "main", .study = kStudy, .series = kSeries};
  request.parameters = R"({"iso": 100})";
  request.send = {{.pacs = "main"}, {.pacs = "main", .format = SendFormat::kObj}};
  const std::string id = submit(request);
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  EXPECT_EQ(get(id).error->type, "urn:isomesh:problem:too-large");
  EXPECT_THAT(files_of_patient(), testing::IsEmpty());
}

TEST_F(EndingOrdersTest, LeaveNoObjectIfTheyAreCancelledWhileItIsMade) {
  store_.before_save = [this](const store::OrderRecord& record) {
    if (record.order.state == OrderState::kSending) orders_->cancel(std::nullopt, record.order.id);
  };
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kCancelled));
  EXPECT_THAT(files_of_patient(), testing::IsEmpty());
}

// Their next step makes the object again.
TEST_F(EndingOrdersTest, LeaveNoObjectIfTheyCannotBeSaved) {
  std::atomic<bool> is_broken = true;
  store_.before_save = [&](const store::OrderRecord& record) {
    const bool has_job = record.order.job && jobs_.get(std::nullopt, *record.order.job).mesh;
    if (has_job && is_broken) throw Error(ErrorCode::kInternal, "the database is read-only");
  };
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return get(id).job.has_value(); }));
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return store_.unsaved() > 0; }));
  EXPECT_THAT(files_of_patient(), testing::IsEmpty());
  is_broken = false;
  begin();
  EXPECT_TRUE(reaches(id, OrderState::kSucceeded));
}

}  // namespace
}  // namespace isomesh::orders
