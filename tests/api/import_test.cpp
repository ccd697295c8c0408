// Uploads that take more than one file, and what they leave in the daemon.
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/support/deflate.h"
#include "tests/unit/import/archives.h"

namespace isomesh::test {
namespace {

using testing::HasSubstr;

constexpr std::string_view kHeader =
    "ObjectType = Image\nNDims = 3\nDimSize = 4 3 2\nElementType = MET_UCHAR\n"
    "ElementSpacing = 1 2 3\nElementDataFile = head.raw\n";

TEST(Import, AFolderAndAHeaderArePackedOnTheWay) {
  const Daemon daemon;
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder / "volume");
  write_file(folder / "volume/head.mhd", kHeader);
  write_file(folder / "volume/head.raw", "abcdefghijklmnopqrstuvwx");
  write_file(folder / "volume/README", "what this is");
  const Finished of_folder = daemon.command({"upload", folder / "volume"});
  EXPECT_EQ(of_folder.status, 0) << of_folder.errors;
  const Finished of_header = daemon.command({"upload", folder / "volume/head.mhd"});
  EXPECT_EQ(of_header.status, 0) << of_header.errors;
  EXPECT_EQ(of_folder.output, of_header.output);
  const Volume volume = daemon.client().volume(of_folder.line());
  EXPECT_EQ(volume.format, "metaimage");
  EXPECT_EQ(volume.geometry.spacing, (std::array<double, 3>{1, 2, 3}));
  const Finished meshed =
      daemon.command({"mesh", folder / "volume", "--iso", "105", "-o", folder / "out.stl"});
  EXPECT_EQ(meshed.status, 0) << meshed.errors;
}

// The locale for such names must be loaded before the process that imports is confined.
TEST(Import, NamesInAZipMayBeUtf8) {
  using import::test::Utf8Names;
  const Daemon daemon;
  for (const Utf8Names names : {Utf8Names::kFlag, Utf8Names::kField}) {
    const std::string zip =
        import::test::zip_in_utf8({{"R\xc3\xbcmpf/head.mhd", std::string(kHeader)},
                                   {"R\xc3\xbcmpf/head.raw", "abcdefghijklmnopqrstuvwx"}},
                                  names);
    const Answer answer = daemon.send("POST", "/v1/volumes", zip);
    EXPECT_EQ(answer.status / 100, 2) << answer.body;
  }
}

TEST(Import, AFolderWithoutFilesIsRefusedByTheCommand) {
  const Daemon daemon;
  const TemporaryFolder folder;
  const Finished result = daemon.command({"upload", folder.path()});
  EXPECT_NE(result.status, 0);
  EXPECT_THAT(result.errors, HasSubstr("contains no files"));
}

TEST(Import, ASeriesIsChosenOnlyWhereThereIsOne) {
  const Daemon daemon;
  const TemporaryFolder folder;
  write_file(folder / "head.mhd", kHeader);
  write_file(folder / "head.raw", "abcdefghijklmnopqrstuvwx");
  const Finished result = daemon.command({"upload", folder / "head.mhd", "--series", "1.2.3"});
  EXPECT_EQ(result.status, 1);
  EXPECT_THAT(result.errors, HasSubstr("series"));
}

TEST(Import, LimitsAreThoseThatAreConfigured) {
  const Daemon daemon({"--imports", "1", "--import-seconds", "100", "--import-memory", "64MiB"});
  EXPECT_EQ(upload(daemon, sphere_upload()).format, "raw");
}

// The sanitizers keep freed memory to find uses of it.
#if !defined(__SANITIZE_ADDRESS__)

std::size_t resident_bytes(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    std::string name;
    std::size_t kibibytes = 0;
    if (words >> name >> kibibytes && name == "VmRSS:") return kibibytes * 1024;
  }
  throw std::runtime_error("the daemon's memory is not told");
}

TEST(Import, AGreatUploadLeavesLittleInTheDaemon) {
  constexpr std::size_t kMost = std::size_t{24} << 20;
  const std::string samples(std::size_t{96} << 20, '\x07');
  const std::string header =
      "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 512 512 384\n"
      "space: LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nencoding: raw\n\n";
  const Daemon daemon;
  upload(daemon, sphere_upload());  // what the first one allocates for good
  const std::size_t before = resident_bytes(daemon.pid());
  const Answer raw = daemon.send("POST", "/v1/volumes?dims=512,512,384&type=uint8", samples);
  EXPECT_EQ(raw.status, 201) << raw.body;
  EXPECT_LT(resident_bytes(daemon.pid()), before + kMost);
  const Answer packed = daemon.send("POST", "/v1/volumes", gzip(header + samples));
  EXPECT_EQ(packed.status, 200) << packed.body;
  EXPECT_LT(resident_bytes(daemon.pid()), before + kMost);
}

#endif

}  // namespace
}  // namespace isomesh::test
