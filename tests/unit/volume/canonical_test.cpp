#include "server/volume/canonical.h"

#include <array>
#include <cstring>
#include <filesystem>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>
#include <sys/mman.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::volume::test {
namespace {

using isomesh::test::read_file;
using isomesh::test::TemporaryFolder;

CanonicalHeader small_header() {
  CanonicalHeader header;
  header.dims = {3, 2, 2};
  header.type = SampleType::kInt16;
  header.geometry.spacing = {0.1, 1.0 / 3, std::numbers::pi};
  header.geometry.origin = {-0.0, 1e-20, 12.5};
  return header;
}

std::string written(const TemporaryFolder& folder, const CanonicalHeader& header) {
  CanonicalWriter writer(folder / "volume", header);
  for (std::size_t at = 0; at < writer.samples().size(); ++at) {
    writer.samples()[at] = static_cast<std::byte>(at);
  }
  return read_file(folder / "volume");
}

TEST(Canonical, IsReadBackExactly) {
  const TemporaryFolder folder;
  written(folder, small_header());
  const CanonicalVolume volume(folder / "volume");
  EXPECT_EQ(volume.header().dims, small_header().dims);
  EXPECT_EQ(volume.header().type, SampleType::kInt16);
  EXPECT_EQ(volume.header().geometry, small_header().geometry);
  ASSERT_EQ(volume.samples().size(), 24U);
  EXPECT_EQ(volume.samples()[23], std::byte{23});
  EXPECT_EQ(reinterpret_cast<std::uintptr_t>(volume.samples().data()) % 4096, 0U);
}

TEST(Canonical, CanBecomeShorter) {
  const TemporaryFolder folder;
  CanonicalHeader header = small_header();
  {
    CanonicalWriter writer(folder / "volume", header);
    const std::size_t size = writer.samples().size();
    header.type = SampleType::kUint8;
    writer.shorten(header);
    EXPECT_EQ(writer.samples().size(), size / 2);
    for (std::size_t at = 0; at < size / 2; ++at) writer.samples()[at] = static_cast<std::byte>(at);
    EXPECT_THROW(writer.shorten(small_header()), Error);
  }
  EXPECT_EQ(read_file(folder / "volume"), written(folder, header));
}

TEST(Canonical, HasOneFormForOneVolume) {
  const TemporaryFolder folder;
  CanonicalHeader header = small_header();
  const std::string with_negative_zero = written(folder, header);
  header.geometry.origin[0] = 0.0;
  EXPECT_EQ(written(folder, header), with_negative_zero);
  EXPECT_EQ(with_negative_zero.substr(0, 52),
            R"({"version":1,"dims":[3,2,2],"type":"int16","spacing")");
  EXPECT_EQ(with_negative_zero[kHeaderBytes - 1], '\n');
  header.geometry.origin[0] = std::numeric_limits<double>::denorm_min();
  EXPECT_NE(written(folder, header), with_negative_zero);
}

TEST(Canonical, RefusesEverythingElse) {
  const TemporaryFolder folder;
  const std::string good = written(folder, small_header());
  const auto refused = [&](const std::string& bytes) {
    isomesh::test::write_file(folder / "other", bytes);
    EXPECT_THROW(CanonicalVolume volume(folder / "other"), Error);
  };
  const auto replaced = [&](std::string_view from, std::string_view to) {
    std::string bytes = good;
    const std::size_t at = bytes.find(from);
    EXPECT_NE(at, std::string::npos);
    bytes.replace(at, from.size(), to);
    if (to.size() > from.size()) bytes.erase(kHeaderBytes - 2, to.size() - from.size());
    if (to.size() < from.size()) bytes.insert(kHeaderBytes - 2, from.size() - to.size(), ' ');
    EXPECT_EQ(bytes.size(), good.size());
    refused(bytes);
  };
  refused("");
  refused(good.substr(0, 100));
  refused(good.substr(0, good.size() - 1));
  refused(good + "x");
  refused(std::string(good.size(), ' '));
  replaced("\"version\":1", "\"version\":2");
  replaced("[3,2,2]", "[3,2,3]");
  replaced("[3,2,2]", "[0,2,2]");
  replaced("[3,2,2]", "[-3,2,2]");
  replaced("[3,2,2]", "[2,3,2] ");
  replaced("[3,2,2]", "[4294967299,2,2]");
  replaced("[3,2,2]", "[4294967295,4294967295,4294967295]");
  replaced("int16", "int64");
  replaced("\"spacing\":[0.1", "\"spacing\":[-0.1");
  replaced("\"spacing\":[0.1", "\"spacing\":[null");
  replaced("12.5", "1e300");
  EXPECT_THROW(CanonicalVolume volume(folder / "absent"), Error);
}

TEST(Canonical, IsCopiedOutOfItsFile) {
  const TemporaryFolder folder;
  written(folder, small_header());
  const CanonicalFile file(folder / "volume");
  EXPECT_EQ(file.header().geometry, small_header().geometry);
  std::array<std::byte, 4> some = {};
  file.read(20, some);
  EXPECT_EQ(some, (std::array{std::byte{20}, std::byte{21}, std::byte{22}, std::byte{23}}));
}

// With a mapped file this would be a signal.
TEST(Canonical, AFileThatIsCutMeanwhileIsDamaged) {
  const TemporaryFolder folder;
  written(folder, small_header());
  const CanonicalFile file(folder / "volume");
  std::filesystem::resize_file(folder / "volume", kHeaderBytes + 22);
  std::array<std::byte, 4> some = {};
  EXPECT_EQ(isomesh::test::code_thrown_by([&] { file.read(20, some); }),
            ErrorCode::kUnusableVolume);
}

TEST(Canonical, MovesWithItsMapping) {
  const TemporaryFolder folder;
  written(folder, small_header());
  CanonicalVolume one(folder / "volume");
  const CanonicalVolume other(std::move(one));
  EXPECT_EQ(other.samples()[5], std::byte{5});
}

// More than any file system holds, so that the first thing done is refused by the disk.
TEST(Canonical, TellsOfAFullDiskBeforeItIsMapped) {
  const TemporaryFolder folder;
  CanonicalHeader header = small_header();
  header.dims = {1U << 20, 1U << 20, 1U << 18};
  try {
    CanonicalWriter writer(folder / "volume", header);
    FAIL() << "There is room for 2^59 bytes.";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kOutOfSpace) << error.what();
  }
}

}  // namespace
}  // namespace isomesh::volume::test
