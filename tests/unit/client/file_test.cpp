#include "client/isomesh/file.h"

#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/files.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using test::error_of;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr auto kKinds = {PartFile::Until::kUnnamed, PartFile::Until::kNamed};

TEST(PartFile, IsSeenOnlyWhenItIsPublished) {
  for (const PartFile::Until kind : kKinds) {
    TemporaryFolder folder;
    PartFile file(folder / "mesh.drc", kind);
    file.write("half");
    EXPECT_FALSE(std::filesystem::exists(folder / "mesh.drc"));
    file.restart();
    file.write("whole");
    file.publish();
    EXPECT_EQ(test::read_file(folder / "mesh.drc"), "whole");
    EXPECT_THAT(test::files_below(folder.path()), ElementsAre("mesh.drc"));
  }
}

TEST(PartFile, LeavesNothingWithoutPublishing) {
  for (const PartFile::Until kind : kKinds) {
    TemporaryFolder folder;
    { PartFile(folder / "mesh.drc", kind).write("half"); }
    EXPECT_THAT(test::files_below(folder.path()), IsEmpty());
  }
}

// In memory, where files without names are possible on every machine.
TEST(PartFile, NothingRemainsOfAProcessThatWasKilled) {
  const TemporaryFolder folder(test::fast_place());
  test::write_file(folder / "old.drc", "old");
  for (const char* name : {"new.drc", "old.drc"}) {
    const pid_t child = ::fork();
    if (child == 0) {
      PartFile file(folder / name);
      file.write("half");
      ::kill(::getpid(), SIGKILL);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(WTERMSIG(status), SIGKILL);
  }
  EXPECT_THAT(test::files_below(folder.path()), ElementsAre("old.drc"));
  EXPECT_EQ(test::read_file(folder / "old.drc"), "old");
}

TEST(PartFile, RemovesWhatNobodyHasWrittenToForADay) {
  const TemporaryFolder folder;
  const auto now = std::filesystem::file_time_type::clock::now();
  for (const auto& [name, hours] : std::vector<std::pair<std::string, int>>{
           {".isomesh-1.part", 25}, {".isomesh-2.part", 23}, {"mesh.part", 25}}) {
    test::write_file(folder / name, "half");
    std::filesystem::last_write_time(folder / name, now - std::chrono::hours(hours));
  }
  std::filesystem::create_directory(folder / ".isomesh-3.part");
  std::filesystem::last_write_time(folder / ".isomesh-3.part", now - std::chrono::hours(25));
  const PartFile file(folder / "mesh.drc");
  EXPECT_THAT(test::files_below(folder.path()), ElementsAre(".isomesh-2.part", "mesh.part"));
  EXPECT_TRUE(std::filesystem::exists(folder / ".isomesh-3.part"));
}

TEST(PartFile, ReplacesAFileThatAppearsMeanwhile) {
  for (const PartFile::Until kind : kKinds) {
    TemporaryFolder folder;
    PartFile file(folder / "mesh.drc", kind);
    file.write("new");
    test::write_file(folder / "mesh.drc", "other");
    file.publish();
    EXPECT_EQ(test::read_file(folder / "mesh.drc"), "new");
    EXPECT_THAT(test::files_below(folder.path()), ElementsAre("mesh.drc"));
  }
}

TEST(PartFile, ReplacesNothingIfItShallNot) {
  for (const PartFile::Until kind : kKinds) {
    const test::TemporaryFolder folder;
    PartFile file(folder / "mesh.drc", kind, Existing::kRefuse);
    file.write("mesh");
    PartFile late(folder / "mesh.drc", kind, Existing::kRefuse);
    late.write("late");
    file.publish();
    EXPECT_EQ(error_of([&] { late.publish(); }).code(), ErrorCode::kInvalidParameter);
    EXPECT_EQ(test::read_file(folder / "mesh.drc"), "mesh");
    EXPECT_EQ(error_of([&] { PartFile(folder / "mesh.drc", kind, Existing::kRefuse); }).code(),
              ErrorCode::kInvalidParameter);
  }
}

TEST(PartFile, TakesTheLongestName) {
  TemporaryFolder folder;
  const std::string name(255, 'a');
  for (const PartFile::Until kind : kKinds) {
    PartFile file(folder / name, kind);
    file.publish();
    EXPECT_THAT(test::files_below(folder.path()), ElementsAre(name));
  }
}

TEST(PartFile, KeepsTheModeOfAFileThatItReplaces) {
  using std::filesystem::perms;
  TemporaryFolder folder;
  for (const PartFile::Until kind : kKinds) {
    for (const perms mode : {perms(0600), perms(0666), perms(0400)}) {
      test::write_file(folder / "mesh.drc", "old");
      std::filesystem::permissions(folder / "mesh.drc", mode);
      { PartFile(folder / "mesh.drc", kind).write("half"); }
      EXPECT_EQ(std::filesystem::status(folder / "mesh.drc").permissions(), mode);
      EXPECT_EQ(test::read_file(folder / "mesh.drc"), "old");
      PartFile file(folder / "mesh.drc", kind);
      file.write("new");
      file.publish();
      EXPECT_EQ(std::filesystem::status(folder / "mesh.drc").permissions(), mode);
      EXPECT_EQ(test::read_file(folder / "mesh.drc"), "new");
      std::filesystem::remove(folder / "mesh.drc");
    }
  }
}

TEST(PartFile, FollowsALink) {
  TemporaryFolder folder;
  test::write_file(folder / "real.drc", "old");
  std::filesystem::create_symlink(folder / "real.drc", folder / "link.drc");
  PartFile file(folder / "link.drc");
  file.write("new");
  file.publish();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.drc"));
  EXPECT_EQ(test::read_file(folder / "real.drc"), "new");
}

TEST(PartFile, FollowsLinksToAFileThatDoesNotExist) {
  TemporaryFolder folder;
  std::filesystem::create_directory(folder / "there");
  std::filesystem::create_symlink("there/link.drc", folder / "link.drc");
  std::filesystem::create_symlink("new.drc", folder / "there" / "link.drc");
  PartFile file(folder / "link.drc");
  file.write("new");
  file.publish();
  EXPECT_TRUE(std::filesystem::is_symlink(folder / "link.drc"));
  EXPECT_EQ(test::read_file(folder / "there" / "new.drc"), "new");
}

TEST(PartFile, RefusesALoopOfLinks) {
  TemporaryFolder folder;
  std::filesystem::create_symlink("loop", folder / "loop");
  EXPECT_EQ(error_of([&] { PartFile(folder / "loop"); }).code(), ErrorCode::kInvalidParameter);
}

// Renaming onto a device would replace it for the whole machine.
TEST(PartFile, RefusesWhatIsNoRegularFile) {
  TemporaryFolder folder;
  EXPECT_EQ(error_of([&] { PartFile(folder / "."); }).code(), ErrorCode::kInvalidParameter);
  EXPECT_EQ(error_of([] { PartFile("/dev/null"); }).code(), ErrorCode::kInvalidParameter);
}

TEST(InputFile, ReadsAnyPartAndNoticesATruncation) {
  TemporaryFolder folder;
  test::write_file(folder / "file", "0123456789");
  const InputFile file = InputFile::chosen(folder / "file");
  EXPECT_EQ(file.size(), 10U);
  std::string part(4, ' ');
  file.read_exactly(3, std::as_writable_bytes(std::span(part)));
  EXPECT_EQ(part, "3456");
  std::filesystem::resize_file(folder / "file", 5);
  EXPECT_EQ(error_of([&] { file.read_exactly(3, std::as_writable_bytes(std::span(part))); }).code(),
            ErrorCode::kInvalidParameter);
}

TEST(InputFile, RefusesAFolder) {
  EXPECT_EQ(error_of([] { InputFile::chosen("/tmp"); }).code(), ErrorCode::kInvalidParameter);
}

}  // namespace
}  // namespace isomesh
