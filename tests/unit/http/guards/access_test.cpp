#include "server/http/guards/access.h"

#include <functional>
#include <string>

#include <gtest/gtest.h>

#include "tests/support/files.h"

namespace isomesh::http {
namespace {

class AccessTest : public testing::Test {
 protected:
  void write(const std::string& token) const {
    test::write_file(file_, token_line("ann", Role::kUser, token) + '\n');
  }

  const test::TemporaryFolder folder_;
  const std::string file_ = folder_ / "tokens";
};

TEST_F(AccessTest, ATokenThatIsRevokedBeforeItsStreamOpensEndsTheStream) {
  const std::string token = make_token();
  write(token);
  Tokens tokens(file_);
  Request request;
  request.path = "/v1/events";
  request.headers = {{"Authorization", "Bearer " + token}};
  Response response;
  begin_request({&tokens, nullptr}, request, response);
  EXPECT_EQ(owner_of(request), "ann");
  const auto early = validity_of({&tokens, nullptr}, request);
  EXPECT_TRUE(early());
  write(make_token());
  tokens.reload();
  EXPECT_FALSE(early());
  const auto late = validity_of({&tokens, nullptr}, request);
  EXPECT_FALSE(late());
}

}  // namespace
}  // namespace isomesh::http
