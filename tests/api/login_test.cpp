// Persons whose tokens come from a login provider (OpenID Connect), and the command with such a
// token.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/login_provider.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

class LoginApiTest : public testing::Test {
 protected:
  LoginApiTest() { provider_.publish(key_.jwk("key")); }

  std::vector<std::string> options() const {
    return {"--oidc-issuer", provider_.issuer(),  "--oidc-audience",
            "isomesh",       "--oidc-role",       "doctors=user",
            "--oidc-role",   "it=admin",          "--log-format",
            "json",          "--oidc-role-claim", "realm.groups"};
  }

  std::string token(const std::string& subject, const std::string& group = "doctors") const {
    return signed_token(
        key_, head_of(key_, "key"),
        claims_of(provider_.issuer(), subject, R"("realm": {"groups": ["x", ")" + group + "\"]}"));
  }

  static Headers bearer(const std::string& token) { return {{"Authorization", "Bearer " + token}}; }

  // Once the daemon has read the keys.
  static bool is_accepted(const Daemon& daemon, const std::string& token) {
    return eventually([&] { return daemon.get("/v1/jobs", bearer(token)).status == 200; });
  }

  const KeyPair key_{"ES256"};
  LoginProvider provider_;
};

TEST_F(LoginApiTest, APersonSeesItsOwnAndTheLogNamesIt) {
  Daemon daemon(options());
  const std::string ann = token("ann");
  ASSERT_TRUE(is_accepted(daemon, ann));
  const RawUpload sphere = sphere_upload();
  const Answer uploaded =
      daemon.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes, bearer(ann));
  ASSERT_EQ(uploaded.status, 201) << uploaded.body;
  const std::string volume = "/v1/volumes/" + volume_from_json(uploaded.body).id;
  EXPECT_EQ(daemon.get(volume, bearer(token("ann"))).status, 200);
  EXPECT_EQ(daemon.get(volume, bearer(token("bob"))).status, 404);
  EXPECT_EQ(daemon.get(volume, bearer(token("boss", "it"))).status, 200);
  const std::string signature = ann.substr(ann.rfind('.'));
  const std::string forged = ann.substr(0, ann.size() - 8) + "AAAAAAAA";
  EXPECT_TRUE(is_problem(daemon.get(volume, bearer(forged)), ErrorCode::kUnauthorized));
  EXPECT_TRUE(
      is_problem(daemon.get(volume, bearer(token("eve", "visitors"))), ErrorCode::kForbidden));
  const Finished listed =
      run({ISOMESH, "--server", daemon.url(), "list"}, {"ISOMESH_TOKEN=" + ann});
  EXPECT_EQ(listed.status, 0) << listed.errors;
  const Finished refused = daemon.command({"--token", forged, "list"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("it was not signed by the login provider"));
  EXPECT_EQ(daemon.stop(), 0);
  EXPECT_THAT(daemon.errors(), HasSubstr(R"("token":"oidc:ann")"));
  EXPECT_THAT(daemon.errors(), Not(HasSubstr(signature)));
  EXPECT_THAT(daemon.errors(), Not(HasSubstr("AAAAAAAA")));
}

TEST_F(LoginApiTest, AProviderThatIsAwayKeepsNobodyElseOut) {
  const TemporaryFolder folder;
  const std::string file = folder / "tokens";
  const std::string scanner = run({ISOMESHD, "token", "add", "ct", "--into", file}).line();
  provider_.break_with(500);
  const Daemon daemon(with(options(), {"--tokens", file}));
  EXPECT_EQ(daemon.get("/v1/jobs", bearer(scanner)).status, 200);
  ASSERT_TRUE(eventually([&] {
    return daemon.get("/v1/jobs", bearer(token("ann"))).body.find("cannot be reached") !=
           std::string::npos;
  }));
  const Answer away = daemon.get("/v1/jobs", bearer(token("ann")));
  EXPECT_TRUE(is_problem(away, ErrorCode::kUnavailable));
  EXPECT_EQ(away.header("retry-after"), "1");
  EXPECT_EQ(daemon.get("/v1/jobs").status, 401);
}

TEST_F(LoginApiTest, LetsTheDaemonListenBeyondThisMachine) {
  const TemporaryFolder folder;
  const Daemon daemon(folder / "data", "0.0.0.0:0", options());
  EXPECT_EQ(daemon.get("/v1/jobs").status, 401);
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--oidc-issuer", "http://login.example", "--oidc-audience", "x"},
           {"--oidc-issuer", "https://login.example"},
           {"--oidc-issuer", "https://login.example", "--oidc-audience", "x", "--oidc-role", "x"},
           {"--oidc-issuer", "https://login.example", "--oidc-audience", "x", "--oidc-ca",
            "/none"}}) {
    const Finished result = refused_start(folder / "other", wrong);
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.errors, HasSubstr(wrong.size() > 4 ? wrong[4].substr(2) : "oidc-"));
  }
}

}  // namespace
}  // namespace isomesh
