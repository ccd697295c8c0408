#include "server/http/guards/read_trail.h"

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/log.h"
#include "proto/error.h"
#include "proto/json_tree.h"
#include "server/store/microseconds.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/http/services.h"

namespace isomesh::http {
namespace {

using testing::AllOf;
using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::chrono::hours kLong{1};
const std::string kSlice = "/v1/volumes/{id}/slice.png";

// Takes entries, and fails after some time while it is away.
class LeavingDatabase : public store::SqlDatabase {
 public:
  static constexpr std::chrono::milliseconds kTakes{300};

  std::int64_t to_us(store::Time time) const override { return store::to_us(time); }
  store::Time from_us(std::int64_t us) const override { return store::from_us(us); }
  std::size_t most_at_once() const override { return 1; }

  std::atomic<bool> is_away = false;
  std::atomic<int> failures = 0;

 private:
  void in_transaction(store::Change /*kind*/,
                      const std::function<void(store::SqlTransaction&)>& /*act*/) override {
    if (!is_away) return;
    std::this_thread::sleep_for(kTakes);
    ++failures;
    throw_away();
  }
  void while_reading(const std::function<void(store::SqlConnection&)>& /*act*/) override {
    throw_away();
  }
  std::size_t tell(store::Change /*kind*/, std::string_view /*sql*/,
                   std::span<const store::Parameter> /*parameters*/) override {
    throw_away();
  }
  store::Rows ask(std::string_view /*sql*/,
                  std::span<const store::Parameter> /*parameters*/) override {
    throw_away();
  }
  [[noreturn]] static void throw_away() {
    throw Error(ErrorCode::kUnavailable, "the database does not respond");
  }
};

class ReadTrailTest : public testing::Test {
 protected:
  ReadTrailTest() {
    Volume volume;
    volume.id = "head";
    volume.dicom = DicomIdentity{};
    volume.dicom->patient_id = "PAT1";
    volume.dicom->study_uid = "1.2.3";
    services_.volumes().add("ann", volume);
    Volume phantom;
    phantom.id = "phantom";
    services_.volumes().add("ann", phantom);
    JobParameters parameters;
    parameters.volume = "head";
    parameters.iso = 1;
    job_ = store::job_of(services_.jobs().submit({"ann", parameters, "", ""})).id;
    open(kLong);
  }

  void open(std::chrono::milliseconds window) {
    trail_.emplace(ReadTrail::Stores{services_.audit(), services_.volumes(), services_.jobs()},
                   window);
  }

  void note(const std::string& route, const std::string& id, int status = 200,
            const std::string& caller = "ann", const std::string& method = "GET") {
    Request request;
    request.method = method;
    request.context.route = route;
    request.context.caller.name = caller;
    request.path_parameters = {{"id", id}};
    request.remote_address = "192.0.2.5";
    Response response;
    response.status = status;
    trail_->note(request, response);
  }

  // Each entry's members, separated by blanks.
  std::vector<std::string> entries() {
    std::vector<std::string> found;
    services_.audit().read(0, [&](std::string_view line) {
      const JsonTree tree(line);
      std::string text;
      for (const char* name :
           {"event", "outcome", "caller", "peer", "what", "volume", "study", "patient_id"}) {
        const Json* const member = json_values::find(tree.root(), name);
        text += (member == nullptr ? "-" : json_values::text(*member)) + ' ';
      }
      const Json* const requests = json_values::find(tree.root(), "requests");
      found.push_back(
          text + (requests == nullptr ? "-" : std::to_string(json_values::whole(*requests, 1000))));
    });
    return found;
  }

  // The number of events that all entries of this kind stand for.
  std::uint64_t told(const std::string& event) {
    std::uint64_t sum = 0;
    services_.audit().read(0, [&](std::string_view line) {
      const JsonTree tree(line);
      if (json_values::text(*json_values::find(tree.root(), "event")) != event) return;
      const Json* const unlisted = json_values::find(tree.root(), "unlisted");
      sum += 1 + (unlisted == nullptr ? 0 : json_values::whole(*unlisted, 1000));
    });
    return sum;
  }

  OpenServices services_;
  std::string job_;
  std::optional<ReadTrail> trail_;
};

TEST_F(ReadTrailTest, NamesReaderPatientAndData) {
  note("/v1/volumes/{id}", "head");
  note("/v1/volumes/{id}/labels", "head");
  note(kSlice, "head", 304);
  note("/v1/jobs/{id}/mesh.{format}", job_, 206);
  note("/v1/jobs/{id}/report", job_, 200, "", "HEAD");
  EXPECT_THAT(entries(), ElementsAre("110112 success ann 192.0.2.5 volume head 1.2.3 PAT1 1",
                                     "110112 success ann 192.0.2.5 labels head 1.2.3 PAT1 1",
                                     "110104 success ann 192.0.2.5 slice head 1.2.3 PAT1 1",
                                     "110104 success ann 192.0.2.5 mesh head 1.2.3 PAT1 1",
                                     "110112 success - 192.0.2.5 report head 1.2.3 PAT1 1"));
}

TEST_F(ReadTrailTest, NamesWhoGetsAVolumeByChangingIt) {
  note("/v1/volumes/{id}", "head", 200, "ann", "PATCH");
  note("/v1/volumes/{id}/reoriented", "head", 201, "bob", "POST");
  EXPECT_THAT(entries(), ElementsAre("110112 success ann 192.0.2.5 volume head 1.2.3 PAT1 1",
                                     "110112 success bob 192.0.2.5 volume head 1.2.3 PAT1 1"));
}

TEST_F(ReadTrailTest, NamesWhoTriedInVain) {
  note("/v1/volumes/{id}", "head", 404, "bob");
  note("/v1/jobs/{id}/mesh.{format}", job_, 403, "bob");
  EXPECT_THAT(entries(), ElementsAre("110112 failure bob 192.0.2.5 volume head 1.2.3 PAT1 1",
                                     "110104 failure bob 192.0.2.5 mesh head 1.2.3 PAT1 1"));
}

TEST_F(ReadTrailTest, HasNothingWithoutAPatient) {
  note("/v1/volumes/{id}", "phantom");
  note(kSlice, "phantom");
  note(kSlice, "unknown", 404);
  note("/v1/jobs/{id}/mesh.{format}", "unknown", 404);
  note(kSlice, "head", 400);
  note(kSlice, "head", 503);
  note("/v1/volumes", "");
  note("/v1/jobs/{id}", job_);
  note("/v1/jobs/{id}/events", job_);
  note("/v1/volumes/{id}", "head", 204, "ann", "DELETE");
  EXPECT_THAT(entries(), IsEmpty());
}

TEST_F(ReadTrailTest, CountsWhatOneViewRequestsAHundredTimes) {
  for (int n = 0; n < 100; ++n) note(kSlice, "head");
  note("/v1/volumes/{id}/slice", "head");
  note(kSlice, "head", 200, "bob");
  const std::string slices = "110104 success ann 192.0.2.5 slice head 1.2.3 PAT1 ";
  const std::string others = "110104 success bob 192.0.2.5 slice head 1.2.3 PAT1 1";
  EXPECT_THAT(entries(), ElementsAre(slices + "1", others));
  trail_.reset();
  EXPECT_THAT(entries(), ElementsAre(slices + "1", others, slices + "100"));
}

TEST_F(ReadTrailTest, EntersACountWhenItsWindowEnds) {
  trail_.reset();
  open(std::chrono::milliseconds(200));
  for (int n = 0; n < 5; ++n) note(kSlice, "head");
  EXPECT_TRUE(test::eventually([&] { return entries().size() == 2; }));
  EXPECT_EQ(entries().back(), "110104 success ann 192.0.2.5 slice head 1.2.3 PAT1 4");
  note(kSlice, "head");
  EXPECT_THAT(entries(), SizeIs(3));
}

// Its thread may not have begun.
TEST_F(ReadTrailTest, EntersACountHoweverEarlyItEnds) {
  for (std::size_t times = 1; times <= 10; ++times) {
    trail_.reset();
    open(kLong);
    note(kSlice, "head");
    note(kSlice, "head");
    trail_.reset();
    EXPECT_THAT(entries(), SizeIs(2 * times));
  }
}

TEST_F(ReadTrailTest, KeepsTheMeshOfAnErasedVolume) {
  services_.jobs().cancel("ann", job_);
  services_.volumes().erase("ann", "head", store::Made::kKept, {});
  note("/v1/jobs/{id}/mesh.{format}", job_);
  note(kSlice, "head", 404);
  EXPECT_THAT(entries(), ElementsAre("110104 success ann 192.0.2.5 mesh head - - 1"));
}

// A login of an OpenID provider is a name like others.
TEST_F(ReadTrailTest, NamesTheSubjectOfALogin) {
  note(kSlice, "head", 200, "oidc:248289761001");
  note("/v1/volumes/{id}", "head", 404, "oidc:248289761001");
  EXPECT_THAT(entries(),
              ElementsAre("110104 success oidc:248289761001 192.0.2.5 slice head 1.2.3 PAT1 1",
                          "110112 failure oidc:248289761001 192.0.2.5 volume head 1.2.3 PAT1 1"));
}

TEST_F(ReadTrailTest, HasWhatNeitherAVolumeNorAJobTells) {
  Request request;
  request.method = "GET";
  request.context.caller.name = "ris";
  request.remote_address = "192.0.2.5";
  Response response;
  response.told = ToldPatient{.what = "workitem", .study = "1.7", .patient_id = "PAT7"};
  for (int n = 0; n < 3; ++n) trail_->note(request, response);
  response.told->patient_id = "PAT8";
  response.status = 403;
  trail_->note(request, response);
  trail_.reset();
  EXPECT_THAT(entries(), ElementsAre("110112 success ris 192.0.2.5 workitem - 1.7 PAT7 1",
                                     "110112 failure ris 192.0.2.5 workitem - 1.7 PAT8 1",
                                     "110112 success ris 192.0.2.5 workitem - 1.7 PAT7 2"));
}

TEST_F(ReadTrailTest, HasOneTryOfWhatARoleDoesNotAllowASecond) {
  for (int n = 0; n < 50; ++n) note("none", "", 403, "grafana", "POST");
  note("none", "", 403, "", "POST");  // a page of another origin
  const std::string entry = "110113 failure grafana 192.0.2.5 permission - - - -";
  EXPECT_EQ(entries().front(), entry);
  trail_.reset();
  EXPECT_THAT(entries(), AllOf(Each(entry), SizeIs(testing::Lt(50))));
  EXPECT_EQ(told("110113"), 50U);
}

// Strangers could fill the trail otherwise.
TEST_F(ReadTrailTest, HasOneRefusedLoginASecond) {
  for (int n = 0; n < 50; ++n) note(kSlice, "head", 401, "");
  const std::string entry = "110114 failure - 192.0.2.5 login - - - -";
  EXPECT_EQ(entries().front(), entry);
  trail_.reset();
  EXPECT_THAT(entries(), AllOf(Each(entry), SizeIs(testing::Lt(50))));
  EXPECT_EQ(told("110114"), 50U);
}

// The number of the others does not wait for another one.
TEST_F(ReadTrailTest, TellsTheNumberOfRefusedLoginsThoughNoneFollows) {
  for (int n = 0; n < 50; ++n) note(kSlice, "head", 401, "");
  EXPECT_TRUE(test::eventually([&] { return told("110114") == 50; }));
}

TEST_F(ReadTrailTest, NamesTheReaderOfAMeshWhoseVolumeHasADamagedRecord) {
  services_.damage_volume("head");
  note("/v1/jobs/{id}/mesh.{format}", job_);
  EXPECT_THAT(entries(), ElementsAre("110104 success ann 192.0.2.5 mesh head - - 1"));
}

TEST_F(ReadTrailTest, ACountThatCannotBeEnteredKeepsNoOthers) {
  services_.database().change(store::Change::kNew, [](store::SqlTransaction& transaction) {
    transaction.connection().run(
        "CREATE TRIGGER refuses BEFORE INSERT ON audit "
        "WHEN NEW.record LIKE '%\"caller\":\"ann\"%\"requests\":2%' "
        "BEGIN SELECT RAISE(ABORT, 'refused'); END");
    transaction.commit();
    return 0;
  });
  trail_.reset();
  open(std::chrono::milliseconds(1000));
  for (int n = 0; n < 3; ++n) note(kSlice, "head", 200, "ann");
  for (int n = 0; n < 4; ++n) note(kSlice, "head", 200, "bob");
  EXPECT_TRUE(test::eventually([&] { return entries().size() == 3; }));
  EXPECT_EQ(entries().back(), "110104 success bob 192.0.2.5 slice head 1.2.3 PAT1 3");
}

TEST_F(ReadTrailTest, TellsHowManyRefusedLoginsItLacksAtTheEnd) {
  LeavingDatabase database;
  store::AuditTrail audit(database);
  trail_.emplace(ReadTrail::Stores{audit, services_.volumes(), services_.jobs()}, kLong);
  database.is_away = true;
  testing::internal::CaptureStderr();
  start_log(LogFormat::kText, LogLevel::kError);
  for (int n = 0; n < 3; ++n) note(kSlice, "head", 401, "");
  trail_.reset();
  start_log(LogFormat::kText, LogLevel::kOff);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::HasSubstr("lacks 0 counts of readings and 3 refused requests"));
}

TEST_F(ReadTrailTest, EndsSoonAndDelaysNoResponseWhileTheDatabaseIsAway) {
  using Clock = std::chrono::steady_clock;
  LeavingDatabase database;
  store::AuditTrail audit(database);
  trail_.emplace(ReadTrail::Stores{audit, services_.volumes(), services_.jobs()},
                 std::chrono::milliseconds(500));
  for (const char* slice : {"one", "another"}) {
    SCOPED_TRACE(slice);
    for (int reader = 0; reader < 20; ++reader) {
      note(kSlice, "head", 200, "reader " + std::to_string(reader));
    }
  }
  database.is_away = true;
  ASSERT_TRUE(test::eventually([&] { return database.failures > 0; }));
  const auto before_response = Clock::now();
  note("/v1/volumes/{id}", "phantom");  // without an entry
  EXPECT_LT(Clock::now() - before_response, LeavingDatabase::kTakes);
  const auto before_end = Clock::now();
  trail_.reset();
  EXPECT_LT(Clock::now() - before_end, 5 * LeavingDatabase::kTakes);
}

}  // namespace
}  // namespace isomesh::http
