#include "server/store/file.h"

#include <csignal>
#include <functional>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/files.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;
using test::TemporaryFolder;

TEST(File, IsCreatedNew) {
  const TemporaryFolder folder;
  File file = File::create(folder / "a");
  file.write(as_span("first "));
  file.write(as_span("second"));
  EXPECT_EQ(file.size(), 12U);
  EXPECT_EQ(test::read_file(folder / "a"), "first second");
  EXPECT_EQ(code_thrown_by([&] { File::create(folder / "a"); }), ErrorCode::kInternal);
  EXPECT_EQ(test::read_file(folder / "a"), "first second");
}

TEST(File, IsForItsOwnerOnly) {
  const TemporaryFolder folder;
  File::create(folder / "a");
  using std::filesystem::perms;
  EXPECT_EQ(std::filesystem::status(folder / "a").permissions(),
            perms::owner_read | perms::owner_write);
}

TEST(File, ThatIsNotThereIsNotFound) {
  const TemporaryFolder folder;
  EXPECT_EQ(code_thrown_by([&] { File::open(folder / "a"); }), ErrorCode::kNotFound);
}

TEST(File, ReadsAtAnyOffset) {
  const TemporaryFolder folder;
  test::write_file(folder / "a", "0123456789");
  const File file = File::open(folder / "a");
  const auto read = [&](std::uint64_t offset, std::size_t length) {
    std::string text(length, '?');
    text.resize(file.read_at(offset, std::as_writable_bytes(std::span(text))));
    return text;
  };
  EXPECT_EQ(read(0, 10), "0123456789");
  EXPECT_EQ(read(3, 4), "3456");
  EXPECT_EQ(read(8, 100), "89");
  EXPECT_EQ(read(10, 5), "");
  EXPECT_EQ(read(1'000'000, 5), "");
}

TEST(File, MovesItsDescriptor) {
  const TemporaryFolder folder;
  test::write_file(folder / "a", "of a");
  test::write_file(folder / "b", "of bb");
  File file = File::open(folder / "a");
  file = File::open(folder / "b");
  const File moved = std::move(file);
  EXPECT_EQ(moved.size(), 5U);
}

// A limit on file sizes fails as a full disk does, and needs no full disk.
TEST(File, WithoutRoomIsOutOfSpace) {
  const TemporaryFolder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before = {};
  ::getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small = {1000, before.rlim_max};
  ::setrlimit(RLIMIT_FSIZE, &small);
  File file = File::create(folder / "a");
  const auto code = code_thrown_by([&] { file.write(as_span(std::string(2000, 'x'))); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(code, ErrorCode::kOutOfSpace);
  EXPECT_EQ(test::files_below(folder.path()), std::vector<std::string>{"a"});
}

TEST(Messages, HoldNoPaths) {
  const TemporaryFolder folder;
  const std::vector<std::function<void()>> failures = {
      [&] { File::open(folder / "absent"); },
      [&] { File::create(folder.path() / "absent" / "file"); },
      [&] { File::create(folder.path()); },
      [&] { read_whole(folder / "absent"); },
      [&] { move_to(folder / "absent", folder / "to"); },
      [&] { sync_folder(folder / "absent"); }};
  for (const auto& failure : failures) {
    const Error error = test::error_of(failure);
    EXPECT_EQ(std::string(error.what()).find(folder.path()), std::string::npos) << error.what();
  }
}

TEST(MoveTo, ReplacesWhatWasThere) {
  const TemporaryFolder folder;
  test::write_file(folder / "from", "text");
  test::write_file(folder / "to", "what was there");
  move_to(folder / "from", folder / "to");
  EXPECT_EQ(test::files_below(folder.path()), std::vector<std::string>{"to"});
  EXPECT_EQ(test::read_file(folder / "to"), "text");
}

}  // namespace
}  // namespace isomesh::store
