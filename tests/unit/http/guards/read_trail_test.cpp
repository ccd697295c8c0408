#include "server/http/guards/read_trail.h"

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json_tree.h"
#include "tests/support/files.h"
#include "tests/support/process.h"
#include "tests/unit/http/services.h"

namespace isomesh::http {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::chrono::hours kLong{1};
const std::string kSlice = "/v1/volumes/{id}/slice.png";

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
  EXPECT_THAT(entries(), ElementsAre("110113 failure grafana 192.0.2.5 permission - - - -"));
}

// Strangers could fill the trail otherwise.
TEST_F(ReadTrailTest, HasOneRefusedLoginASecond) {
  for (int n = 0; n < 50; ++n) note(kSlice, "head", 401, "");
  EXPECT_THAT(entries(), ElementsAre("110114 failure - 192.0.2.5 login - - - -"));
}

}  // namespace
}  // namespace isomesh::http
