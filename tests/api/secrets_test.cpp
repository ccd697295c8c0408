// A callback's address may hold a secret. It is its job's alone: no mesh and no line of the log has
// it.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/api/daemon.h"
#include "tests/support/enumerators.h"
#include "tests/support/receiver.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

const std::string kKeyInUrl = "c9a1f0e2-not-for-others";

class CallbackSecret : public testing::Test {
 protected:
  // All of a surface; a ZIP is for labels.
  static std::vector<std::string> formats() {
    std::vector<std::string> all = names<MeshFormat>();
    std::erase(all, "zip");
    return all;
  }

  // A mesh in every format, with everything that it may carry.
  static std::string everything() {
    return R"("normals": true, "formats": )" + json(formats()).dump();
  }

  std::string callback() const {
    return R"("callback": {"url": ")" + receiver_.url() + "/hooks/iso?key=" + kKeyInUrl + "\"}";
  }

  void expect_clean_meshes(const Job& job) const {
    ASSERT_TRUE(job.mesh);
    EXPECT_EQ(job.mesh->files.size(), formats().size());
    for (const auto& [format, file] : job.mesh->files) {
      const std::string bytes = daemon_.get(file.href).body;
      EXPECT_EQ(bytes.size(), file.bytes);
      for (const std::string& word : {kKeyInUrl, receiver_.url(), std::string("callback")}) {
        EXPECT_EQ(bytes.find(word), std::string::npos) << to_string(format) << " holds " << word;
      }
    }
  }

  TemporaryFolder folder_;
  const Receiver receiver_{{503, 204}};  // the first attempt fails, which is logged as well
  Daemon daemon_{folder_ / "data", "127.0.0.1:0", options()};

 private:
  std::vector<std::string> options() const {
    write_file(folder_ / "secret", "thirty-two bytes of secret, at least\n");
    return {"--callback-allow", receiver_.url() + "/hooks", "--callback-secret-file",
            folder_ / "secret", "--callback-retry-seconds", "0.05"};
  }
};

TEST_F(CallbackSecret, StandsInNoMeshAlsoWhenAnotherJobTakesIt) {
  const Job asked = finished_job(daemon_, callback() + ", " + everything());
  ASSERT_TRUE(asked.parameters.callback);
  expect_clean_meshes(asked);
  const Volume volume = daemon_.client().volume(asked.parameters.volume);
  const Job other =
      daemon_.client().wait(submit(daemon_, volume, *asked.parameters.iso, everything()).id);
  EXPECT_TRUE(other.reused);
  EXPECT_FALSE(other.parameters.callback);
  expect_clean_meshes(other);
}

TEST_F(CallbackSecret, StandsInNoLineOfTheLog) {
  const Job job = finished_job(daemon_, callback());
  ASSERT_TRUE(receiver_.gets(2));
  // Refused: an address that nobody has listed, and a request that has no callbacks.
  const std::string elsewhere = "http://elsewhere.example/?key=" + kKeyInUrl;
  for (const std::string& url : {elsewhere, "nonsense " + kKeyInUrl}) {
    const json body = {
        {"volume", job.parameters.volume}, {"iso", 100}, {"callback", {{"url", url}}}};
    EXPECT_EQ(daemon_.send("POST", "/v1/jobs", body.dump()).status, 400);
  }
  EXPECT_EQ(daemon_.send("POST", "/v1/mesh?iso=1&callback=" + kKeyInUrl, "x").status, 400);
  EXPECT_EQ(daemon_.get("/v1/estimate?iso=1&callback=" + kKeyInUrl).status, 400);
  EXPECT_EQ(daemon_.stop(), 0);
  EXPECT_THAT(daemon_.errors(), HasSubstr("callback"));
  EXPECT_THAT(daemon_.errors(), Not(HasSubstr(kKeyInUrl)));
}

}  // namespace
}  // namespace isomesh
