#include "server/net/listener.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "proto/error.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::net {
namespace {

TEST(Listener, FindsAFreePortAndSaysWhich) {
  const Listener listener(parse_address("127.0.0.1:0"));
  EXPECT_GE(listener.descriptor(), 0);
  EXPECT_THAT(listener.authority(), testing::MatchesRegex("127.0.0.1:[1-9][0-9]*"));
  // The authority is an address again, and it is taken.
  const Address same = parse_address(listener.authority());
  EXPECT_EQ(test::code_thrown_by([&] { Listener{same}; }), ErrorCode::kUnavailable);
}

TEST(Listener, RefusesAnAddressThatIsNotOfThisMachine) {
  for (const std::string text : {"192.0.2.1:0", "no-such-host.invalid:0"}) {
    EXPECT_EQ(test::code_thrown_by([&] { Listener{parse_address(text)}; }), ErrorCode::kUnavailable)
        << text;
  }
}

TEST(Listener, AUnixSocketReplacesADeadOneAndIsRemoved) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "socket";
  const Address address = parse_address("unix:" + path.string());
  {
    const Listener dead(address);
    std::filesystem::rename(path, folder / "kept");
  }
  std::filesystem::rename(folder / "kept", path);
  {
    const Listener listener(address);
    EXPECT_EQ(listener.authority(), "unix:" + path.string());
    struct stat status = {};
    ASSERT_EQ(::stat(path.c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777U, 0660U);
  }
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST(Listener, AUnixSocketOfALivingProgramStays) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "socket";
  const Address address = parse_address("unix:" + path.string());
  {
    const Listener living(address);
    EXPECT_EQ(test::code_thrown_by([&] { Listener{address}; }), ErrorCode::kUnavailable);
    EXPECT_TRUE(std::filesystem::exists(path));
    std::filesystem::remove(path);
    test::write_file(path, "another's");
  }
  EXPECT_TRUE(std::filesystem::exists(path));
}

TEST(Listener, AFileThatIsNoSocketStays) {
  const test::TemporaryFolder folder;
  test::write_file(folder / "file", "text");
  const Address address = parse_address("unix:" + (folder / "file").string());
  EXPECT_EQ(test::code_thrown_by([&] { Listener{address}; }), ErrorCode::kUnavailable);
  EXPECT_TRUE(std::filesystem::exists(folder / "file"));
}

}  // namespace
}  // namespace isomesh::net
