#include "server/callbacks/signature.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::callbacks {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

class SecretsTest : public testing::Test {
 protected:
  std::filesystem::path file(const std::string& text) {
    std::filesystem::path path = folder_ / "secrets";
    test::write_file(path, text);
    return path;
  }

  test::TemporaryFolder folder_;
};

// The example of the specification's reference libraries.
TEST_F(SecretsTest, SignsAsTheSpecificationDoes) {
  const auto secrets = read_callback_secrets(file("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw\n"));
  EXPECT_EQ(callback_signature(secrets, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1614265330,
                               R"({"test": 2432232314})"),
            "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
}

TEST_F(SecretsTest, EachKeySigns) {
  const std::string first = "the first key, of 24 bytes or more";
  const std::string second = "the second key, of 24 bytes or more";
  EXPECT_THAT(read_callback_secrets(file(first + "\r\n\n" + second)), ElementsAre(first, second));
  EXPECT_EQ(
      callback_signature({first, second}, "a", 1, "b"),
      callback_signature({first}, "a", 1, "b") + ' ' + callback_signature({second}, "a", 1, "b"));
  EXPECT_NE(callback_signature({first}, "a", 1, "b"), callback_signature({first}, "a", 2, "b"));
  EXPECT_NE(callback_signature({first}, "a", 1, "b"), callback_signature({first}, "b", 1, "b"));
}

TEST_F(SecretsTest, AWrongFileIsRefusedWithoutItsText) {
  for (const std::string text :
       {"", "\n\n", "too-short-a-key", "whsec_notbase64!", "whsec_", "whsec_c2hvcnQ="}) {
    const Error error = test::error_of([&] { read_callback_secrets(file(text)); }, text);
    EXPECT_THAT(error.what(), HasSubstr("callback-secret-file"));
    EXPECT_THAT(error.what(), Not(HasSubstr("too-short-a")));
  }
  EXPECT_TRUE(test::thrown_by([&] { read_callback_secrets(folder_ / "absent"); }));
}

}  // namespace
}  // namespace isomesh::callbacks
