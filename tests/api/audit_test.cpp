// The trail of who reads the data of patients, through a day behind a reverse proxy.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/text.h"
#include "proto/json.h"
#include "proto/json_tree.h"
#include "server/import/dicom/elements/tags.h"
#include "tests/api/daemon.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/dicom/objects.h"

namespace isomesh {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

std::string ct_of_a_patient() {
  const import::test::DicomSeries ct;
  std::vector<import::test::Member> members;
  for (const auto& [name, bytes] : changed(ct, [](import::test::DicomObject& slice) {
         slice.text(import::dicom::kPatientId, "LO", "PAT1");
         slice.text(import::dicom::kStudyInstanceUid, "UI", "1.2.3");
       })) {
    members.push_back({name, bytes});
  }
  return import::test::zip(members);
}

class AuditTest : public testing::Test {
 protected:
  std::string made(const std::string& name) const {
    return run({ISOMESHD, "token", "add", name, "--role", "user", "--into", file_}).line();
  }

  // From a client of the proxy.
  static Headers from(const std::string& token, const std::string& address) {
    return {{"Authorization", "Bearer " + token}, {"X-Forwarded-For", "203.0.113.9, " + address}};
  }

  // The values of each entry, separated by blanks.
  std::vector<std::string> entries(const Daemon& daemon) const {
    const Finished printed = run({ISOMESHD, "audit", "--data", daemon.data().string()});
    EXPECT_EQ(printed.status, 0) << printed.errors;
    std::vector<std::string> found;
    for (const std::string_view line : lines(printed.output)) {
      const JsonTree tree(line);
      std::string text;
      for (const char* name :
           {"event", "outcome", "caller", "peer", "what", "study", "patient_id"}) {
        const Json* const member = json_values::find(tree.root(), name);
        text += (member == nullptr ? "-" : json_values::text(*member)) + ' ';
      }
      const Json* const requests = json_values::find(tree.root(), "requests");
      if (requests != nullptr) text += std::to_string(json_values::whole(*requests, 1000));
      found.push_back(text);
    }
    return found;
  }

  const TemporaryFolder folder_;
  const std::string file_ = folder_ / "tokens";
  const std::string ann_ = made("ann");
  const std::string bob_ = made("bob");
};

TEST_F(AuditTest, HasEachReaderOfAPatientOfADay) {
  Daemon daemon({"--tokens", file_, "--trusted-proxy", "127.0.0.1,10.1.0.0/16"});
  const Answer uploaded =
      daemon.send("POST", "/v1/volumes", ct_of_a_patient(), from(ann_, "192.0.2.5"));
  ASSERT_EQ(uploaded.status, 201) << uploaded.body;
  const std::string volume = volume_from_json(uploaded.body).id;
  const std::string path = "/v1/volumes/" + volume;
  const auto get = [&](const std::string& target, const Headers& headers) {
    return daemon.get(target, headers).status;
  };
  EXPECT_EQ(get(path, from(ann_, "192.0.2.5")), 200);
  for (int n = 0; n < 8; ++n) {
    const std::string slice = path + "/slice.png?index=" + std::to_string(n % 4);
    EXPECT_EQ(get(slice, from(ann_, "192.0.2.5, 10.1.2.3")), 200);
  }
  const Answer job = daemon.send("POST", "/v1/jobs?wait=60",
                                 R"({"iso":1000,"formats":["stl"],"volume":")" + volume + R"("})",
                                 from(ann_, "192.0.2.5"));
  ASSERT_EQ(job.status, 200) << job.body;
  EXPECT_EQ(get("/v1/jobs/" + job_from_json(job.body).id + "/mesh.stl", from(ann_, "192.0.2.8")),
            200);
  EXPECT_EQ(get(path, from(bob_, "192.0.2.6")), 404);
  EXPECT_EQ(get(path + "/slice", from("isomesh_unknown", "192.0.2.7")), 401);
  EXPECT_EQ(daemon.stop(), 0);
  EXPECT_THAT(entries(daemon), ElementsAre("110112 success ann 192.0.2.5 volume 1.2.3 PAT1 1",
                                           "110104 success ann 192.0.2.5 slice 1.2.3 PAT1 1",
                                           "110104 success ann 192.0.2.8 mesh 1.2.3 PAT1 1",
                                           "110112 failure bob 192.0.2.6 volume 1.2.3 PAT1 1",
                                           "110114 failure - 192.0.2.7 login - - ",
                                           "110104 success ann 192.0.2.5 slice 1.2.3 PAT1 7"));
  EXPECT_EQ(run({ISOMESHD, "audit", "--verify", "--data", daemon.data().string()}).status, 0);
  EXPECT_THAT(daemon.errors(), Not(HasSubstr("PAT1")));
}

}  // namespace
}  // namespace isomesh
