#include "server/callbacks/callbacks.h"

#include <algorithm>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/callbacks/signature.h"
#include "server/store/files/data_folder.h"
#include "server/store/sql/outbox.h"
#include "server/store/sqlite/database.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/support/receiver.h"

namespace isomesh::callbacks {
namespace {

using test::eventually;
using test::Received;
using test::Receiver;
using testing::ElementsAre;
using testing::HasSubstr;
using enum CallbackOutcome;

class CallbacksTest : public testing::Test {
 protected:
  // As a job that has ended does it.
  Job ended(const std::string& id, const std::string& url) {
    Job job;
    job.id = id;
    job.state = JobState::kFailed;
    job.parameters.callback = Callback{url};
    store::Transaction transaction(database_.writer());
    store::add_callback(transaction.connection(), id, url, to_json(job));
    transaction.commit();
    return job;
  }

  CallbackObserver observer() {
    return [this](const store::Delivery& delivery, CallbackOutcome outcome,
                  const std::string& reason) {
      const std::lock_guard lock(mutex_);
      outcomes_.push_back(outcome);
      reasons_.insert(reason);
      if (outcome != kRetried) over_.insert(delivery.job);
    };
  }

  bool is_over(const std::string& job) {
    return eventually([&] {
      const std::lock_guard lock(mutex_);
      return over_.contains(job);
    });
  }

  CallbackOptions options() const {
    CallbackOptions options;
    options.secrets = {kSecret};
    options.timeout = std::chrono::seconds(20);
    options.first_delay = std::chrono::milliseconds(10);
    return options;
  }

  inline static const std::string kSecret = "a secret of 24 bytes or more";
  test::TemporaryFolder folder_;
  store::DataFolder data_{folder_ / "data"};
  store::Database database_{data_};
  store::SqlOutbox outbox_{database_};
  std::mutex mutex_;  // guards what follows
  std::vector<CallbackOutcome> outcomes_;
  std::set<std::string> reasons_;
  std::set<std::string> over_;
};

TEST_F(CallbacksTest, AreRepeatedUntilTheyAreAnsweredWithSuccess) {
  const Receiver receiver({500, 503, 200});
  const CallbackTargets targets({receiver.url()});
  const Job job = ended("job-1", receiver.url() + "/in?key=1");
  Callbacks callbacks(outbox_, targets, options(), observer());
  ASSERT_TRUE(is_over("job-1"));
  EXPECT_THAT(outcomes_, ElementsAre(kRetried, kRetried, kDelivered));
  EXPECT_THAT(reasons_, ElementsAre("", "status 500", "status 503"));
  EXPECT_EQ(outbox_.count(), 0U);
  const std::vector<Received> received = receiver.received();
  ASSERT_EQ(received.size(), 3U);
  for (const Received& each : received) {
    EXPECT_EQ(each.path, "/in");
    EXPECT_EQ(each.body, to_json(job));
    EXPECT_EQ(each.headers.at("content-type"), "application/json");
    EXPECT_EQ(each.headers.at("webhook-id"), "job-1");
    EXPECT_EQ(each.headers.at("webhook-signature"),
              callback_signature({kSecret}, "job-1",
                                 std::stoll(each.headers.at("webhook-timestamp")), each.body));
  }
}

TEST_F(CallbacksTest, AReceiverThatHangsHoldsUpItselfAlone) {
  const Receiver hanging({0});
  const Receiver other;
  const CallbackTargets targets({hanging.url(), other.url()});
  for (int n = 0; n < 100; ++n) ended("hanging-" + std::to_string(n), hanging.url());
  ended("other", other.url());
  Callbacks callbacks(outbox_, targets, options(), observer());
  EXPECT_TRUE(is_over("other"));
  EXPECT_LE(hanging.received().size(), 8U);  // few at once
  EXPECT_EQ(outbox_.count(), 100U);
}

TEST_F(CallbacksTest, AnAttemptIsOverWhenItsTimeIs) {
  const Receiver hanging({0, 204});
  const CallbackTargets targets({hanging.url()});
  ended("job-1", hanging.url());
  CallbackOptions hasty = options();
  hasty.timeout = std::chrono::milliseconds(200);
  Callbacks callbacks(outbox_, targets, hasty, observer());
  EXPECT_TRUE(is_over("job-1"));
  EXPECT_GE(outcomes_.size(), 2U);
  EXPECT_EQ(outcomes_.front(), kRetried);
}

TEST_F(CallbacksTest, AreGivenUpWhenTheyAreOldOrUnwanted) {
  const Receiver failing({500});
  const Receiver gone({410});
  const Receiver elsewhere;
  const CallbackTargets targets({failing.url(), gone.url()});
  ended("old", failing.url());
  ended("unwanted", gone.url());
  ended("not allowed any more", elsewhere.url());
  CallbackOptions impatient = options();
  impatient.give_up_after = std::chrono::milliseconds(0);
  Callbacks callbacks(outbox_, targets, impatient, observer());
  for (const std::string job : {"old", "unwanted", "not allowed any more"}) {
    EXPECT_TRUE(is_over(job));
  }
  EXPECT_THAT(outcomes_, ElementsAre(kGivenUp, kGivenUp, kGivenUp));
  EXPECT_EQ(outbox_.count(), 0U);
  EXPECT_TRUE(elsewhere.received().empty());
}

// A receiver could not read it, and others wait for no one.
TEST_F(CallbacksTest, ADamagedOneIsGivenUpAndHoldsUpNoOther) {
  const Receiver receiver;
  ended("damaged", receiver.url());
  ended("other", receiver.url());
  database_.writer().script(
      "UPDATE callbacks SET body = substr(body, 1, 20) || x'ff' || substr(body, 21), attempts = -7 "
      "WHERE job = 'damaged'");
  database_.writer().script("UPDATE callbacks SET attempts = -7");
  const CallbackTargets targets({receiver.url()});
  const Callbacks callbacks(outbox_, targets, options(), observer());
  EXPECT_TRUE(is_over("damaged"));
  EXPECT_TRUE(is_over("other"));
  EXPECT_EQ(receiver.received().size(), 1U);
  EXPECT_TRUE(reasons_.contains("its record is damaged"));
}

TEST_F(CallbacksTest, FollowNoRedirect) {
  const Receiver receiver({302, 204});
  const CallbackTargets targets({receiver.url()});
  ended("job-1", receiver.url() + "/in");
  Callbacks callbacks(outbox_, targets, options(), observer());
  ASSERT_TRUE(is_over("job-1"));
  EXPECT_TRUE(std::ranges::none_of(receiver.received(),
                                   [](const Received& each) { return each.path == "/elsewhere"; }));
  EXPECT_THAT(outcomes_, ElementsAre(kRetried, kDelivered));
}

// The address is what counts, not the name that led to it.
TEST_F(CallbacksTest, ANameThatLeadsInsideIsNotConnectedTo) {
  const Receiver receiver;
  const CallbackTargets open({receiver.url_by_name()});
  const CallbackTargets inside({"private:" + receiver.url_by_name()});
  ended("job-1", receiver.url_by_name());
  {
    Callbacks callbacks(outbox_, open, options(), observer());
    ASSERT_TRUE(eventually([&] {
      const std::lock_guard lock(mutex_);
      return !outcomes_.empty();
    }));
  }
  EXPECT_THAT(
      reasons_,
      ElementsAre("the host name of the receiver resolves to an address that is not allowed"));
  EXPECT_TRUE(receiver.received().empty());
  Callbacks callbacks(outbox_, inside, options(), observer());
  EXPECT_TRUE(is_over("job-1"));
}

TEST_F(CallbacksTest, ANewSecretSignsFromThenOn) {
  const Receiver receiver;
  const CallbackTargets targets({receiver.url()});
  Callbacks callbacks(outbox_, targets, options(), observer());
  callbacks.set_secrets({"another secret of 24 bytes or more"});
  ended("job-1", receiver.url());
  callbacks.wake();
  ASSERT_TRUE(is_over("job-1"));
  const Received received = receiver.received().at(0);
  EXPECT_EQ(
      received.headers.at("webhook-signature"),
      callback_signature({"another secret of 24 bytes or more"}, "job-1",
                         std::stoll(received.headers.at("webhook-timestamp")), received.body));
}

}  // namespace
}  // namespace isomesh::callbacks
