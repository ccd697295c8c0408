// The way of an order, from its series to its object.
#include "server/hospital/orders/orders.h"

#include "tests/unit/hospital/fixture.h"

namespace isomesh::orders {
namespace {

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
  // No record names the object any more, whether or not its bytes still exist.
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
  EXPECT_THAT(outcomes_of("110112", late), ElementsAre("failure"));
  const std::string prompt = submit();
  ASSERT_TRUE(until([&] { return !outcomes_of("110112", prompt).empty(); }));
  EXPECT_THAT(outcomes_of("110112", prompt), ElementsAre("success"));
}

TEST_F(OrdersTest, AnEmptySurfaceIsToldWithTheReasonOfItsJob) {
  const std::string id = submit();
  ASSERT_TRUE(finish_job(0));
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  const Problem error = get(id).error.value();
  EXPECT_EQ(error.type, "urn:isomesh:problem:empty-surface");
  EXPECT_EQ(error.detail, "the surface is empty: the iso-value separates no samples");
}

// Each label is an object, and each object an entry of the order's results.
TEST_F(OrdersTest, OfMoreLabelsThanAnOrderMayHaveObjectsFail) {
  labels_of_mesh_ = 501;
  const std::string id = submit();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kFailed));
  const Order order = get(id);
  EXPECT_EQ(order.error->type, "urn:isomesh:problem:too-large");
  EXPECT_THAT(order.error->detail, testing::HasSubstr("501 labels"));
  EXPECT_TRUE(order.results.empty());
  EXPECT_EQ(main_->stores, 0);
}

// Both series have the same samples.
TEST_F(OrdersTest, HaveTheNamesOfTheirOwnSegments) {
  std::set<std::string> volumes;
  for (const char* name : {"Left kidney", "Right kidney"}) {
    main_->hold({segmentation_file(name)});
    const std::string id = submit("main", kSeries, R"({"labels": "all"})");
    ASSERT_TRUE(finish_job()) << name;
    EXPECT_EQ(last_parameters_.label_names, (LabelTexts{{1, name}}));
    ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
    volumes.insert(get(id).volume.value());
  }
  EXPECT_EQ(volumes.size(), 2U);
  EXPECT_EQ(main_->stores, 2);
}

// The step in progress leaves no trace, because the other process makes it.
TEST_F(OrdersTest, PauseWhileAnotherProcessHasThem) {
  main_->hangs = true;
  const std::string begun = submit();
  ASSERT_TRUE(until([&] { return main_->calls > 0; }));
  lose_orders();
  ASSERT_TRUE(until([&] { return main_->aborted > 0; }));
  EXPECT_TRUE(orders_->is_paused());
  main_->hangs = false;
  const std::string later = submit();
  const store::Time paused = now();
  ASSERT_TRUE(until([&] { return store_.looked_at() > paused; }));
  EXPECT_EQ(main_->calls, 1);
  for (const std::string& id : {begun, later}) {
    EXPECT_EQ(get(id).state, OrderState::kWaiting);
    EXPECT_EQ(get(id).attempts, 0U);
  }
  orders_->cancel(std::nullopt, later);
  regain_orders();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(begun, OrderState::kSucceeded));
  EXPECT_FALSE(orders_->is_paused());
}

class UnusableOrdersTest : public OrdersTest {
 protected:
  // The error of an order of a series with these files.
  Problem error_of(const std::vector<std::string>& files) {
    main_->hold(files);
    main_->sent_slices = static_cast<int>(files.size());
    const std::string id = submit();
    if (!reaches(id, OrderState::kFailed)) return {};
    return get(id).error.value();
  }
};

// The place of an image in the response means nothing to a user.
TEST_F(UnusableOrdersTest, NameTheImageByItsInstance) {
  std::vector<std::string> files;
  for (int slice = 0; slice < kSlices; ++slice) files.push_back(slice_file(slice));
  const std::string orientation = "1\\0\\0\\0\\1\\0";
  std::vector<std::string> crooked = files;
  crooked[2].replace(crooked[2].find(orientation), orientation.size(), "1\\0\\0\\0\\1\\x");
  EXPECT_THAT(error_of(crooked).detail,
              testing::StartsWith("Instance number 9 (SOP Instance UID 1.2.2.2): "));
  files[1] = "nothing";
  EXPECT_THAT(error_of(files).detail, testing::StartsWith("Part 2 of the response: "));
}

// The PACS would show the study with a name of question marks, or file the mesh under another
// patient.
TEST_F(UnusableOrdersTest, OfAPatientIdThatCannotBeReadFailAtOnce) {
  std::vector<std::string> files;
  for (int slice = 0; slice < kSlices; ++slice) {
    std::string file = slice_file(slice, "PAT-\xe4");
    file.insert(file.find(element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2")),
                element(8, 5, "CS", "ISO_IR 192"));
    files.push_back(file);
  }
  const Problem error = error_of(files);
  EXPECT_EQ(error.type, "urn:isomesh:problem:unusable-volume");
  EXPECT_THAT(error.detail, testing::HasSubstr("the Patient ID of the images"));
  EXPECT_EQ(main_->stores, 0);
}

// The images have crossed the network all the same.
TEST_F(UnusableOrdersTest, HaveTheirTransferInTheAuditTrail) {
  ASSERT_NE(error_of({"nothing"}).detail, "");
  std::vector<std::string> transfers;
  audit_.read(0, [&](std::string_view line) {
    const auto entry = nlohmann::json::parse(line);
    if (entry.at("event") != "110104") return;
    EXPECT_EQ(entry.at("study"), kStudy);
    EXPECT_EQ(entry.at("instances"), 1);
    transfers.push_back(entry.at("outcome"));
  });
  EXPECT_THAT(transfers, ElementsAre("failure"));
}

TEST_F(UnusableOrdersTest, DoNotOfferParametersThatOrdersLack) {
  std::vector<std::string> files;
  for (int phase = 0; phase < 2; ++phase) {
    for (int slice = 0; slice < kSlices; ++slice) {
      files.push_back(slice_file(slice, "PAT-1", phase));
    }
  }
  const Problem error = error_of(files);
  EXPECT_THAT(error.detail,
              testing::StartsWith("The series holds 2 volumes that differ in AcquisitionNumber. An "
                                  "order has no parameter for this. Download the series, and "
                                  "upload it with volume=N: 0 ("));
  EXPECT_EQ(error.remedy, Remedy());
}

class FittingOrdersTest : public OrdersTest {
 protected:
  FittingOrdersTest() {
    settings_.pacs.front().max_send_bytes = 20'000;
    Rule rule;
    rule.name = "fit";
    rule.max_error_mm = 0.5;
    rule.parameters = R"({"iso": 100})";
    rule.send = {{.pacs = "main"}};
    settings_.rules = {rule};
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
    settings_.rules = {rule};
    settings_.settle = minutes(1);
    settings_.poll = seconds(1);
    settings_.dimse.emplace().routes = {{"BONE", "bone"}};
    peers_[received_by("BONE")].source = std::make_shared<Received>("BONE", received_, blobs_);
    begin();
  }
  void receive(int from, int to, const std::string& title = "BONE",
               const std::string& patient = "PAT-1") {
    const auto receiving = received_.begin_receiving();
    for (int slice = from; slice < to; ++slice) {
      const store::Blob blob = test::put(blobs_, slice_file(slice, patient));
      received_.add({title, kStudy, kSeries}, {instance_of(slice), blob.key, blob.bytes});
      blobs_.mark_named(blob.key);
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

// The mesh of the first has the same UIDs, but the patient of before.
TEST_F(ReceivedOrdersTest, OfACorrectedPatientAreMadeAnewAndDoNotTrustTheFormerMesh) {
  receive(0, kSlices);
  pass(minutes(2));
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(until([&] { return !all().empty() && is_final(all().front().state); }));
  pass(minutes(1));
  ASSERT_TRUE(until([&] { return !is_held(); }));
  receive(0, kSlices, "BONE", "PAT-2");
  pass(minutes(2));
  ASSERT_TRUE(until([&] { return all().size() == 2; }));
  const std::string id = all().front().id;
  // The samples are the same, and so is the mesh: no job runs.
  ASSERT_TRUE(until([&] { return get(id).error.has_value(); }));
  EXPECT_THAT(get(id).error->detail, testing::HasSubstr("another Patient ID"));
  EXPECT_EQ(main_->stores, 1);
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

// One wrong bit in a sample is no fault that a reader of DICOM could see.
TEST_F(ReceivedOrdersTest, OfADamagedImageFailAndNameIt) {
  receive(0, kSlices);
  const auto damaged = received_.instances({"BONE", kStudy, kSeries}).at(2);
  std::string bytes = blob(damaged.blob);
  bytes.back() ^= 0x40;
  test::write_file(blobs_.path_of(damaged.blob), bytes);
  pass(minutes(2));
  ASSERT_TRUE(until([&] { return all().size() == 1 && is_final(all().front().state); }));
  const Order order = all().front();
  EXPECT_EQ(order.state, OrderState::kFailed);
  EXPECT_EQ(order.error.value().type, "urn:isomesh:problem:unusable-volume");
  EXPECT_THAT(order.error->detail, testing::HasSubstr(damaged.instance));
  EXPECT_THAT(order.error->detail, testing::HasSubstr("send the whole series again"));
}

TEST_F(ReceivedOrdersTest, AreMadeThoughAnotherSeriesCannotBeRead) {
  orders_.reset();
  settings_.poll = minutes(1);
  settings_.dimse->routes["BROKEN"] = "bone";
  settings_.dimse->routes["SOUND"] = "bone";
  peers_[received_by("SOUND")].source = std::make_shared<Received>("SOUND", received_, blobs_);
  begin();
  receive(0, kSlices, "BROKEN");
  receive(0, kSlices, "SOUND");
  pass(minutes(2));
  EXPECT_TRUE(until([&] { return all().size() == 1; }));
  // It waits as long as one whose order is open.
  const int failures = received_.failures();
  ASSERT_TRUE(is_looked_at());
  EXPECT_EQ(received_.failures(), failures);
}

// However many wait for it.
TEST_F(OrdersTest, OfOnePacsThatHangsHoldUpNoOther) {
  main_->hangs = true;
  for (int count = 0; count < 220; ++count) submit("main");
  const std::string other = submit("other");
  EXPECT_TRUE(until([&] { return get(other).job.has_value(); }));
  main_->hangs = false;
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

TEST_F(OrdersTest, ThatAreCancelledImportNothing) {
  main_->on_fetched = [this] {
    const Order fetched = orders_->list(std::nullopt, {}, "", 1).front();
    orders_->cancel(std::nullopt, fetched.id);
  };
  const std::string id = submit();
  ASSERT_TRUE(reaches(id, OrderState::kCancelled));
  stop();
  EXPECT_TRUE(volumes_.list("", {}, 100, store::ListOrder::kOldestFirst).empty());
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

// Such a step would never be aborted, so a PACS that hangs would delay the stop.
TEST_F(OrdersTest, BeginNoStepAfterTheStop) {
  store_.hold();
  const std::string id = submit();
  ASSERT_TRUE(until([&] { return store_.waiting() > 0; }));
  stop();  // releases what it holds after it has aborted the steps
  EXPECT_EQ(main_->calls, 0);
  begin();
  ASSERT_TRUE(finish_job());
  ASSERT_TRUE(reaches(id, OrderState::kSucceeded));
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
