#include "server/http/guards/tokens.h"

#include <filesystem>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::http {
namespace {

using testing::HasSubstr;

class TokensTest : public testing::Test {
 protected:
  std::filesystem::path file(const std::string& text) {
    std::filesystem::path path = folder_ / "tokens";
    test::write_file(path, text);
    return path;
  }

  test::TemporaryFolder folder_;
  const std::string ct_ = make_token();
  const std::string admin_ = make_token();
};

TEST_F(TokensTest, AreFoundByWhatWasPrintedOnce) {
  const Tokens tokens(file("# who may ask\n\n" + token_line("ct", Role::kUser, ct_) + "\n  " +
                           token_line("boss", Role::kAdmin, admin_) + "\r\n"));
  EXPECT_EQ(tokens.find(ct_), (Caller{"ct", Role::kUser}));
  EXPECT_EQ(tokens.find(admin_), (Caller{"boss", Role::kAdmin}));
}

TEST_F(TokensTest, NothingElseIsFound) {
  const std::string line = token_line("ct", Role::kUser, ct_);
  const Tokens tokens(file(line));
  const std::string hash = line.substr(line.rfind(' ') + 1);
  for (const std::string& other :
       {std::string(), make_token(), ct_ + "0", ct_.substr(0, ct_.size() - 1), hash,
        std::string("ct"), ct_ + '\0', std::string(100'000, 'x')}) {
    EXPECT_EQ(tokens.find(other), std::nullopt) << other.substr(0, 80);
  }
}

// The file is what an attacker may read in a backup.
TEST_F(TokensTest, TheLineDoesNotHoldTheToken) {
  const std::string secret = ct_.substr(ct_.find('_') + 1);
  EXPECT_EQ(secret.size(), 64U);
  EXPECT_THAT(token_line("ct", Role::kUser, ct_), testing::Not(HasSubstr(secret)));
  EXPECT_EQ(std::set<std::string>({make_token(), make_token(), make_token()}).size(), 3U);
}

TEST_F(TokensTest, OneNameMayHaveSeveralTokensButOneRole) {
  const std::string first = token_line("ct", Role::kUser, ct_) + '\n';
  const Tokens both(file(first + token_line("ct", Role::kUser, admin_)));
  EXPECT_EQ(both.find(ct_), both.find(admin_));
  const Error error =
      test::error_of([&] { Tokens(file(first + token_line("ct", Role::kAdmin, admin_))); });
  EXPECT_THAT(error.what(), HasSubstr("line 2"));
}

TEST_F(TokensTest, AWrongFileIsRefusedByItsLineAndNotItsText) {
  const std::string good = token_line("ct", Role::kUser, ct_);
  for (const std::string& wrong :
       {std::string("ct user"), std::string("ct user 00ff"),
        std::string("ct root") + good.substr(7), "c t" + good.substr(2), "c/t" + good.substr(2),
        good + " more", good + "0", std::string(65, 'n') + good.substr(2), "ct user " + ct_}) {
    const Error error = test::error_of([&] { Tokens(file(good + '\n' + wrong + '\n')); }, wrong);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(error.what(), HasSubstr("line 2"));
    EXPECT_THAT(error.what(), testing::Not(HasSubstr(ct_))) << "tells a token put there by mistake";
  }
  EXPECT_TRUE(test::thrown_by([&] { Tokens(file("# nobody\n")); }));
  EXPECT_TRUE(test::thrown_by([&] { Tokens(folder_ / "absent"); }));
}

TEST_F(TokensTest, AFileOfAnotherUserIsRefused) {
  EXPECT_TRUE(may_own_tokens(0, 1000));
  EXPECT_TRUE(may_own_tokens(1000, 1000));
  EXPECT_FALSE(may_own_tokens(1001, 1000));
  EXPECT_FALSE(may_own_tokens(1000, 0));
  const std::filesystem::path path = file(token_line("ct", Role::kUser, ct_));
  constexpr uid_t kSomebody = 4711;
  const bool is_given_away = ::chown(path.c_str(), kSomebody, static_cast<gid_t>(-1)) == 0;
  EXPECT_EQ(is_given_away, ::geteuid() == 0);  // only root can
  EXPECT_EQ(test::thrown_by([&] { Tokens{path}; }).has_value(), is_given_away);
}

TEST_F(TokensTest, AFileThatOthersMayWriteToIsRefused) {
  namespace fs = std::filesystem;
  const fs::path path = file(token_line("ct", Role::kUser, ct_));
  for (const fs::perms extra : {fs::perms::group_write, fs::perms::others_write}) {
    fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write | extra);
    const Error error = test::error_of([&] { Tokens{path}; });
    EXPECT_THAT(error.what(), HasSubstr("write"));
  }
}

TEST(TokenLine, TakesPlainNamesOnly) {
  for (const std::string& name : {std::string(), std::string("a b"), std::string("a\nb"),
                                  std::string("#a"), std::string(65, 'a')}) {
    EXPECT_TRUE(test::thrown_by([&] { token_line(name, Role::kUser, "x"); })) << name;
  }
}

TEST(BearerOf, TakesTheSchemeInAnyCase) {
  EXPECT_EQ(bearer_of("Bearer abc"), "abc");
  EXPECT_EQ(bearer_of("bearer   abc "), "abc");
  for (const std::string& other :
       {std::string(), std::string("Bearer"), std::string("Bearer "), std::string("Basic abc"),
        std::string("Bearerabc"), std::string("abc"), "Bearer " + std::string(8100, 'x')}) {
    EXPECT_EQ(bearer_of(other), std::nullopt) << other;
  }
}

}  // namespace
}  // namespace isomesh::http
