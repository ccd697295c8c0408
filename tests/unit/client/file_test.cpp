#include "client/isomesh/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/files.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using test::error_of;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::IsEmpty;

TEST(PartFile, IsSeenOnlyWhenItIsPublished) {
  TemporaryFolder folder;
  PartFile file(folder / "mesh.drc");
  file.write("half");
  EXPECT_FALSE(std::filesystem::exists(folder / "mesh.drc"));
  file.restart();
  file.write("whole");
  file.publish();
  EXPECT_EQ(test::read_file(folder / "mesh.drc"), "whole");
  EXPECT_THAT(test::files_below(folder.path()), ElementsAre("mesh.drc"));
}

TEST(PartFile, LeavesNothingWithoutPublishing) {
  TemporaryFolder folder;
  { PartFile(folder / "mesh.drc").write("half"); }
  EXPECT_THAT(test::files_below(folder.path()), IsEmpty());
}

TEST(PartFile, TakesTheLongestName) {
  TemporaryFolder folder;
  const std::string name(255, 'a');
  PartFile file(folder / name);
  file.publish();
  EXPECT_THAT(test::files_below(folder.path()), ElementsAre(name));
}

TEST(PartFile, KeepsTheModeOfAFileThatItReplaces) {
  using std::filesystem::perms;
  TemporaryFolder folder;
  for (const perms mode : {perms(0600), perms(0666), perms(0400)}) {
    test::write_file(folder / "mesh.drc", "old");
    std::filesystem::permissions(folder / "mesh.drc", mode);
    PartFile file(folder / "mesh.drc");
    file.write("new");
    file.publish();
    EXPECT_EQ(std::filesystem::status(folder / "mesh.drc").permissions(), mode);
    EXPECT_EQ(test::read_file(folder / "mesh.drc"), "new");
    std::filesystem::remove(folder / "mesh.drc");
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
