#include "server/store/files/data_folder.h"

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include "base/log.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using test::TemporaryFolder;

TEST(DataFolder, CreatesWhatIsMissing) {
  const TemporaryFolder parent;
  const DataFolder folder(parent.path() / "a" / "b");
  EXPECT_TRUE(std::filesystem::is_directory(folder.blobs()));
  EXPECT_TRUE(std::filesystem::is_directory(folder.scratch()));
}

TEST(DataFolder, IsForItsOwnerOnlyUnlessItWasThere) {
  const TemporaryFolder parent;
  const auto rights = [](const std::filesystem::path& path) {
    return std::filesystem::status(path).permissions();
  };
  const DataFolder made(parent / "made");
  EXPECT_EQ(rights(parent / "made"), std::filesystem::perms::owner_all);
  std::filesystem::create_directory(parent / "there");
  const auto before = rights(parent / "there");
  const DataFolder there(parent / "there");
  EXPECT_EQ(rights(parent / "there"), before);
}

TEST(DataFolder, RefusesASecondHolder) {
  const TemporaryFolder parent;
  std::optional<DataFolder> first(std::in_place, parent / "data");
  EXPECT_EQ(test::code_thrown_by([&] { DataFolder second(parent / "data"); }),
            ErrorCode::kUnavailable);
  first.reset();
  EXPECT_EQ(test::code_thrown_by([&] { DataFolder second(parent / "data"); }), std::nullopt);
}

// As a process that a daemon was starting when it was killed.
TEST(DataFolder, WaitsAMomentForAHolderThatGoes) {
  const TemporaryFolder parent;
  std::optional<DataFolder> first(std::in_place, parent / "data");
  const std::jthread leaving([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    first.reset();
  });
  EXPECT_EQ(test::code_thrown_by([&] { DataFolder second(parent / "data"); }), std::nullopt);
}

TEST(DataFolder, ARefusedHolderTouchesNothing) {
  const TemporaryFolder parent;
  const DataFolder first(parent / "data");
  test::write_file(first.scratch() / "upload", "under way");
  EXPECT_TRUE(test::code_thrown_by([&] { DataFolder second(parent / "data"); }));
  EXPECT_EQ(test::read_file(first.scratch() / "upload"), "under way");
}

TEST(DataFolder, IsTheSameByAnyPath) {
  const TemporaryFolder parent;
  const DataFolder first(parent / "data");
  std::filesystem::create_symlink(parent / "data", parent / "link");
  EXPECT_EQ(test::code_thrown_by([&] { DataFolder second(parent / "link"); }),
            ErrorCode::kUnavailable);
  EXPECT_EQ(test::code_thrown_by([&] { DataFolder second(parent / "data/../data/"); }),
            ErrorCode::kUnavailable);
}

TEST(DataFolder, KeepsWhatIsFinishedAndEmptiesScratch) {
  const TemporaryFolder parent;
  {
    const DataFolder folder(parent / "data");
    test::write_file(folder.blobs() / "blob", "1");
    test::write_file(folder.records(), "2");
    test::write_file(folder.scratch() / "file", "3");
    std::filesystem::create_directories(folder.scratch() / "deep" / "er");
    test::write_file(folder.scratch() / "deep" / "er" / "file", "4");
  }
  const DataFolder folder(parent / "data");
  EXPECT_EQ(test::read_file(folder.blobs() / "blob"), "1");
  EXPECT_EQ(test::read_file(folder.records()), "2");
  EXPECT_TRUE(std::filesystem::is_empty(folder.scratch()));
}

TEST(DataFolder, ThatCannotBeMadeIsRefusedWithoutItsPath) {
  const TemporaryFolder parent;
  test::write_file(parent / "file", "not a folder");
  const Error error = test::error_of([&] { DataFolder folder(parent.path() / "file" / "data"); });
  EXPECT_EQ(error.code(), ErrorCode::kInternal);
  EXPECT_EQ(std::string(error.what()).find(parent.path()), std::string::npos);
}

// As left by root, who started the daemon once.
TEST(DataFolder, WithFilesOfAnotherUserIsRefusedWithTheirName) {
  const TemporaryFolder parent;
  { const DataFolder folder(parent / "data"); }
  test::write_file(parent / "data/blobs/identity", "a name");
  std::filesystem::permissions(parent.path(), std::filesystem::perms::all);
  std::filesystem::permissions(parent / "data", std::filesystem::perms::all);
  for (const auto& entry : std::filesystem::recursive_directory_iterator(parent / "data")) {
    std::filesystem::permissions(entry, std::filesystem::perms::all);
  }
  std::filesystem::permissions(parent / "data/blobs/identity", std::filesystem::perms::owner_read);
  const uid_t user = ::geteuid();
  constexpr uid_t kNobody = 65534;
  ASSERT_EQ(::seteuid(user == 0 ? kNobody : user), 0);
  const auto error = test::thrown_by([&] { DataFolder folder(parent / "data"); });
  ASSERT_EQ(::seteuid(user), 0);
  ASSERT_TRUE(error);
  EXPECT_STREQ(error->what(),
               "the data folder: this user must be able to write to blobs/identity: Permission "
               "denied");
}

TEST(DataFolder, ThatIsAwayIsMissingUntilItIsBack) {
  const TemporaryFolder parent;
  const DataFolder folder(parent / "data");
  EXPECT_TRUE(folder.responds());
  start_log(LogFormat::kText, LogLevel::kInfo);
  testing::internal::CaptureStderr();
  std::filesystem::rename(parent / "data", parent / "away");
  EXPECT_FALSE(folder.responds());
  std::optional<DataFolder> second(std::in_place, parent / "data");
  EXPECT_EQ(test::code_thrown_by([&] { folder.check_is_there(); }), ErrorCode::kUnavailable);
  const auto files = test::files_below(parent / "data");
  test::write_file(folder.scratch() / "file", "of the first");
  folder.name();
  EXPECT_EQ(test::files_below(parent / "data"), files);
  EXPECT_EQ(test::read_file(parent / "away/scratch/file"), "of the first");
  EXPECT_TRUE(second->responds());
  second.reset();
  std::filesystem::remove_all(parent / "data");
  std::filesystem::rename(parent / "away", parent / "data");
  EXPECT_TRUE(folder.responds());
  const std::string log = testing::internal::GetCapturedStderr();
  start_log(LogFormat::kText, LogLevel::kOff);
  // Volumes and meshes may be elsewhere.
  EXPECT_THAT(log, testing::MatchesRegex("[^\n]* error [^\n]*the data folder is missing[^\n]*\n"
                                         "[^\n]* info [^\n]*the data folder is back[^\n]*\n"));
}

TEST(ScratchFolder, GoesWithAllThatItHolds) {
  const TemporaryFolder parent;
  {
    const ScratchFolder one(parent.path());
    const ScratchFolder other(parent.path());
    EXPECT_NE(one.path(), other.path());
    EXPECT_EQ(one.path().parent_path(), parent.path());
    std::filesystem::create_directories(one.path() / "deep");
    test::write_file(one.path() / "deep" / "file", "text");
  }
  EXPECT_TRUE(std::filesystem::is_empty(parent.path()));
}

}  // namespace
}  // namespace isomesh::store
