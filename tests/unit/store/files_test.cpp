#include "server/store/files.h"

#include <algorithm>
#include <csignal>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::as_span;
using test::code_thrown_by;
using test::TemporaryFolder;

std::string sha256_of(std::string_view text) {
  Sha256 digest;
  digest.update(as_span(text));
  return to_hex(digest.finish());
}

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
  const auto whole = code_thrown_by([&] { write_whole(folder / "b", std::string(2000, 'x')); });
  ::setrlimit(RLIMIT_FSIZE, &before);
  EXPECT_EQ(code, ErrorCode::kOutOfSpace);
  EXPECT_EQ(whole, ErrorCode::kOutOfSpace);
  EXPECT_EQ(test::files_below(folder.path()), std::vector<std::string>{"a"});
}

TEST(Messages, HoldNoPaths) {
  const TemporaryFolder folder;
  const std::vector<std::function<void()>> failures = {
      [&] { File::open(folder / "absent"); },
      [&] { File::create(folder.path() / "absent" / "file"); },
      [&] { File::create(folder.path()); },
      [&] { read_whole(folder / "absent"); },
      [&] { write_whole(folder.path() / "absent" / "file", "text"); },
      [&] { publish(folder / "absent", folder / "to"); },
      [&] { sync_folder(folder / "absent"); }};
  for (const auto& failure : failures) {
    const auto error = test::thrown_by(failure);
    ASSERT_TRUE(error);
    EXPECT_EQ(std::string(error->what()).find(folder.path()), std::string::npos) << error->what();
  }
}

TEST(WriteWhole, WritesAndReplaces) {
  const TemporaryFolder folder;
  write_whole(folder / "a", "first");
  EXPECT_EQ(read_whole(folder / "a"), "first");
  write_whole(folder / "a", "");
  EXPECT_EQ(read_whole(folder / "a"), "");
  EXPECT_EQ(test::files_below(folder.path()), std::vector<std::string>{"a"});
}

TEST(WriteWhole, LeavesNothingBehindWhenItFails) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "taken");
  std::filesystem::create_directory(folder.path() / "taken" / "inside");
  EXPECT_TRUE(code_thrown_by([&] { write_whole(folder / "taken", "text"); }));
  EXPECT_TRUE(test::files_below(folder.path()).empty());
}

// Whoever reads while it is replaced sees one text or the other.
TEST(WriteWhole, IsSeenWholeOrNotAtAll) {
  const TemporaryFolder folder;
  const std::string short_text(10, 'a');
  const std::string long_text(100'000, 'b');
  write_whole(folder / "file", short_text);
  std::jthread writer([&](const std::stop_token& stop) {
    for (bool turn = false; !stop.stop_requested(); turn = !turn) {
      write_whole(folder / "file", turn ? short_text : long_text);
    }
  });
  for (int look = 0; look < 2000; ++look) {
    const std::string text = read_whole(folder / "file");
    ASSERT_TRUE(text == short_text || text == long_text) << text.size() << " bytes";
  }
}

TEST(Publish, MovesAFileToItsPlace) {
  const TemporaryFolder folder;
  test::write_file(folder / "from", "text");
  test::write_file(folder / "to", "what was there");
  publish(folder / "from", folder / "to");
  EXPECT_EQ(test::files_below(folder.path()), std::vector<std::string>{"to"});
  EXPECT_EQ(test::read_file(folder / "to"), "text");
}

// FIPS 180-2, appendix B, and the digest of nothing.
TEST(Sha256, GivesTheKnownDigests) {
  EXPECT_EQ(sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_of(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, DoesNotDependOnThePieces) {
  const std::string text(1000, 'x');
  for (const std::size_t piece : {1U, 7U, 63U, 64U, 65U, 999U}) {
    Sha256 digest;
    for (std::size_t begin = 0; begin < text.size(); begin += piece) {
      digest.update(as_span(std::string_view(text).substr(begin, piece)));
    }
    EXPECT_EQ(to_hex(digest.finish()), sha256_of(text)) << piece;
  }
}

TEST(ToHex, IsLowerCaseWithBothDigits) {
  const std::vector<std::uint8_t> bytes = {0x00, 0x0f, 0xa0, 0xff};
  EXPECT_EQ(to_hex(bytes), "000fa0ff");
  EXPECT_EQ(to_hex({}), "");
}

TEST(RandomHex, HasItsLengthAndIsNeverTheSame) {
  std::set<std::string> seen;
  for (int n = 0; n < 1000; ++n) {
    const std::string text = random_hex(8);
    EXPECT_EQ(text.size(), 16U);
    EXPECT_EQ(text.find_first_not_of("0123456789abcdef"), std::string::npos);
    EXPECT_TRUE(seen.insert(text).second);
  }
}

TEST(TimeOrderedId, IsAUuidOfVersion7) {
  const auto is_uuid =
      testing::MatchesRegex("[0-9a-f]{8}-[0-9a-f]{4}-7[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}");
  for (int n = 0; n < 100; ++n) EXPECT_THAT(time_ordered_id(), is_uuid);
}

TEST(TimeOrderedId, IsNeverTheSameAlsoFromThreads) {
  std::mutex mutex;
  std::set<std::string> seen;
  {
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 4; ++thread) {
      threads.emplace_back([&] {
        for (int n = 0; n < 500; ++n) {
          const std::string id = time_ordered_id();
          const std::lock_guard lock(mutex);
          seen.insert(id);
        }
      });
    }
  }
  EXPECT_EQ(seen.size(), 2000U);
}

// The order in which jobs are listed and pages continue.
TEST(TimeOrderedId, SortsByTheTimeThatItWasMade) {
  std::vector<std::string> ids;
  for (int n = 0; n < 1000; ++n) ids.push_back(time_ordered_id());
  EXPECT_TRUE(std::ranges::is_sorted(ids));
}

TEST(Timestamp, IsRfc3339InUtcWithMilliseconds) {
  const auto is_timestamp =
      testing::MatchesRegex("20[0-9]{2}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3}Z");
  std::vector<std::string> stamps;
  for (int n = 0; n < 100; ++n) {
    stamps.push_back(timestamp());
    EXPECT_THAT(stamps.back(), is_timestamp);
  }
  EXPECT_TRUE(std::ranges::is_sorted(stamps));
}

}  // namespace
}  // namespace isomesh::store
