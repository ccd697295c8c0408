#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/store/s3/address.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::code_thrown_by;
using test::error_of;
using testing::HasSubstr;
using testing::Not;

TEST(S3Address, NamesBucketPrefixAndService) {
  const S3Address own =
      parse_s3_url("s3://meshes/of/us?endpoint=https://s3.example:9000&region=x-1");
  EXPECT_EQ(own.endpoint, "https://s3.example:9000");
  EXPECT_EQ(own.path, "/meshes");
  EXPECT_EQ(own.prefix, "of/us/");
  EXPECT_EQ(own.region, "x-1");
  const S3Address aws = parse_s3_url("s3://meshes?region=eu-central-1");
  EXPECT_EQ(aws.endpoint, "https://meshes.s3.eu-central-1.amazonaws.com");
  EXPECT_EQ(aws.path, "");
  EXPECT_EQ(aws.prefix, "");
  EXPECT_EQ(parse_s3_url("s3://abc?endpoint=http://h&style=host").endpoint, "http://abc.h");
  EXPECT_EQ(parse_s3_url("s3://abc").region, "us-east-1");
}

TEST(S3Address, IsRefusedWhereItMakesNoSense) {
  for (const char* text :
       {"s3://", "s3://ab", "s3://UPPER", "s3://a b c", "s3://bucket/a//b", "s3://bucket/%41",
        "s3://bucket?", "s3://bucket?region", "s3://bucket?key=1", "s3://bucket?region=a&region=b",
        "s3://bucket?endpoint=s3.example", "s3://bucket?endpoint=http://",
        "s3://bucket?endpoint=http://user:secret@host", "s3://bucket?endpoint=http://host/path",
        "s3://bucket?style=other", "s3://bucket?region=a/b"}) {
    EXPECT_EQ(code_thrown_by([&] { parse_s3_url(text); }), ErrorCode::kInvalidParameter) << text;
  }
}

TEST(S3Credentials, ComeFromTheDefaultSectionOfAFile) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "keys",
                   "[other]\naws_access_key_id = wrong\n[default]\n# mine\naws_access_key_id = id\n"
                   "aws_secret_access_key=a=b/c+d\naws_session_token = t\n");
  const S3Credentials keys = read_s3_credentials(folder / "keys");
  EXPECT_EQ(keys.access_key, "id");
  EXPECT_EQ(keys.secret_key, "a=b/c+d");
  EXPECT_EQ(keys.session_token, "t");
}

TEST(S3Credentials, AreNeverRepeated) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "keys", "aws_secret_access_key = geheim\n");
  const Error error = error_of([&] { read_s3_credentials(folder / "keys"); });
  EXPECT_EQ(test::fields_of(error), std::vector<std::string>{"blob-credentials"});
  EXPECT_THAT(error.what(), Not(HasSubstr("geheim")));
  EXPECT_EQ(code_thrown_by([&] { read_s3_credentials(folder / "absent"); }),
            ErrorCode::kInvalidParameter);
}

}  // namespace
}  // namespace isomesh::store
