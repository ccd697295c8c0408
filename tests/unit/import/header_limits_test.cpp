// Headers of many lines, or of long ones: what they cost, and where they end.
#include <fstream>
#include <functional>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/import/source/line_reader.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/other_writers.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

const std::string kSamples(kSmallSamples);
constexpr std::size_t kMiB = std::size_t{1} << 20;

// The bytes that this process has read from files, by the kernel's count.
std::uint64_t bytes_read() {
  std::ifstream file("/proc/self/io");
  std::string name;
  std::uint64_t count = 0;
  if (!(file >> name >> count) || name != "rchar:") throw std::runtime_error("no /proc/self/io");
  return count;
}

std::uint64_t bytes_read_by(const std::function<void()>& action) {
  const std::uint64_t before = bytes_read();
  action();
  return bytes_read() - before;
}

std::string repeated(const std::string& text, std::size_t count) {
  std::string all;
  all.reserve(text.size() * count);
  for (std::size_t at = 0; at < count; ++at) all += text;
  return all;
}

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnusableVolume);
    return error.what();
  }
  return "";
}

// --- LineReader ----------------------------------------------------------------------------------

TEST(LineReader, TakesLinesAcrossItsBuffer) {
  const Folder folder;
  const std::string wide(200'000, 'x');
  const InputFile file(folder.write("a", "one\r\n" + wide + "\n\n \t\n  two  \nlast"));
  LineReader lines(file, {.header = "The header"});
  EXPECT_EQ(lines.next(), "one\r");
  EXPECT_EQ(lines.next(), wide);
  EXPECT_EQ(lines.next(), "");
  EXPECT_EQ(lines.next_filled(), "two");
  EXPECT_EQ(lines.offset(), file.size() - 4);
  EXPECT_EQ(lines.next(), "last");
  EXPECT_EQ(lines.next(), std::nullopt);
  lines.move_to(5);
  EXPECT_EQ(lines.next(), wide);
  lines.move_to(file.size() - 4);
  EXPECT_EQ(lines.next_ended(), std::nullopt);
  lines.move_to(file.size() + 1);
  EXPECT_EQ(lines.next(), std::nullopt);
}

TEST(LineReader, SkipsBytesThatAreNoLines) {
  const Folder folder;
  const InputFile file(folder.write("a", "one\n" + std::string(200'000, 'x') + "two\n"));
  LineReader lines(file, {.header = "The header", .bytes = 8, .lines = 2});
  lines.next();
  for (std::size_t left = 200'000; left > 0;) {
    const std::size_t count = std::min(left, lines.view().size());
    ASSERT_GT(count, 0U);
    lines.drop(count);
    left -= count;
  }
  EXPECT_EQ(lines.next(), "two");
  EXPECT_TRUE(lines.view().empty());
}

TEST(LineReader, NamesTheLimitThatIsExceeded) {
  const Folder folder;
  const InputFile file(folder.write("a", "12345\n12345\n1"));
  const auto error = [&](const LineLimits& limits) {
    LineReader lines(file, limits);
    return error_of([&] {
      while (lines.next()) continue;
    });
  };
  EXPECT_EQ(error({.header = "The header", .bytes = 13, .lines = 3}), "");
  EXPECT_EQ(error({.header = "The header", .bytes = 12}),
            "The header has more than the 12 bytes that are supported.");
  EXPECT_EQ(error({.header = "The header", .bytes = 3}),
            "The header has more than the 3 bytes that are supported.");
  EXPECT_EQ(error({.header = "The header", .lines = 2}),
            "The header has more than the 2 lines that are supported.");
}

TEST(LineReader, ReadsALongLineOnlyUpToItsLimit) {
  const Folder folder;
  const InputFile file(folder.write("a", std::string(8 * kMiB, 'x')));
  const std::uint64_t count = bytes_read_by([&] {
    LineReader lines(file, {.header = "The header", .bytes = 100'000});
    EXPECT_THAT(error_of([&] { lines.next(); }), HasSubstr("100000 bytes"));
  });
  EXPECT_LT(count, 300'000U);
}

// --- Formats -------------------------------------------------------------------------------------

TEST(HeaderLimits, ALineOfAVtkFileCostsItsBytes) {
  const std::string file =
      vtk_legacy(true, "POINT_DATA 24\n" + std::string(90'000, '\n') +
                           "SCALARS s char\nLOOKUP_TABLE default\n" + repeated("7 ", 24));
  const std::uint64_t count = bytes_read_by([&] { EXPECT_EQ(import_bytes(file).error, ""); });
  EXPECT_LT(count, 3 * kMiB);
}

TEST(HeaderLimits, AnArrayOfAVtkFileCostsItsBytes) {
  constexpr std::size_t kArrays = 900;
  std::string arrays;
  for (std::size_t at = 0; at < kArrays; ++at) {
    arrays += "a" + std::to_string(at) + " 1 1 int\n7\n";
  }
  const std::string file =
      vtk_legacy(true, "CELL_DATA 1\nFIELD f 900\n" + arrays +
                           "POINT_DATA 24\nSCALARS s char\nLOOKUP_TABLE default\n" +
                           repeated("7 ", 24) + std::string(kMiB, '\n'));
  const std::uint64_t count = bytes_read_by([&] { EXPECT_EQ(import_bytes(file).error, ""); });
  EXPECT_LT(count, 8 * kMiB);
}

std::string behind_first_line(std::string file, const std::string& more) {
  return file.insert(file.find('\n') + 1, more);
}

TEST(HeaderLimits, AreNamedByTheFilesThatExceedThem) {
  const std::string small_nrrd_file = nrrd(small_nrrd(), kSamples);
  const std::string metaimage_header = "ObjectType = Image\nNDims = 3\n";
  const std::string many_lines = vtk_legacy(true, "POINT_DATA 24\n" + std::string(200'000, '\n'));
  std::string many_elements = vti({.form = VtiForm::kBinary}, kSamples);
  many_elements.insert(many_elements.find("</ImageData>"), repeated("<a/>", 100'000));
  const std::pair<std::string, std::string> rows[] = {
      {many_lines, "The VTK file's list of arrays has more than the 100000 lines"},
      // Compressed to a few hundred bytes.
      {gzip(many_lines), "The VTK file's list of arrays has more than the 100000 lines"},
      {vtk_legacy(true, "POINT_DATA 24\nFIELD f 4000000000\n" + repeated("a 1 1 int\n7\n", 5000)),
       "The VTK file has more than the 1000 arrays"},
      {"# vtk DataFile Version 3.0\ntitle\nASCII\n" + std::string(70'000, ' ') +
           "\nDATASET STRUCTURED_POINTS\n",
       "The VTK file's header has more than the 65536 bytes"},
      {many_elements, "The VTK file has more than the 100000 elements"},
      {behind_first_line(small_nrrd_file, repeated("# " + std::string(100, 'x') + '\n', 11'000)),
       "The NRRD header has more than the 1048576 bytes"},
      {behind_first_line(small_nrrd_file, repeated("#\n", 100'000)),
       "The NRRD header has more than the 100000 lines"},
      {metaimage_header + std::string(200'000, '\n'),
       "The MetaImage header has more than the 100000 lines"},
      {metaimage_header + "Comment = " + std::string(2 * kMiB, 'x'),
       "The MetaImage header has more than the 1048576 bytes"},
      {cube({.atoms = "900000 0 0 0"}, repeated("6 6 0 0 0\n", 200'000)),
       "The header of the cube file has more than the 100000 lines"}};
  for (const auto& [file, error] : rows) {
    EXPECT_EQ(import_bytes(file).error, error + " that are supported.");
  }
}

TEST(HeaderLimits, AListOfDataFilesHasTheSame) {
  const std::string names = std::string(200'000, '\n');
  const auto error = [&](const std::string& name, const std::string& header) {
    return import_bytes(zip({{name, header + names}, {"a.raw", kSamples}})).error;
  };
  Lines lines = small_nrrd();
  lines.emplace_back("data file", "LIST");
  std::string listed = nrrd(lines, "");
  listed.pop_back();  // the empty line
  EXPECT_THAT(error("a.nhdr", listed),
              HasSubstr("The NRRD header's list of files has more than the 100000 lines"));
  EXPECT_THAT(error("a.mhd", metaimage(with(small_metaimage(), "ElementDataFile", "LIST"), "")),
              HasSubstr("The MetaImage header's list of files has more than the 100000 lines"));
}

TEST(HeaderLimits, APatternOfDataFilesIsShort) {
  const std::string pattern = std::string(5000, 'x') + "%05d.raw 1 65000 1";
  EXPECT_THAT(import_bytes(nrrd(with(small_nrrd(), "data file", pattern), "")).error,
              HasSubstr("which is not a pattern"));
}

TEST(HeaderLimits, AnAfniDatasetWithALongHeaderSaysSo) {
  const std::string head = afni_head({}) + std::string(kMiB, '\n');
  EXPECT_THAT(import_bytes(zip({{"a+orig.HEAD", head}, {"a+orig.BRIK", kSamples}})).error,
              HasSubstr("The AFNI header has more than the 100000 lines that are supported."));
}

TEST(HeaderLimits, AParHeaderMayBeLongerThanTheBeginningOfAFile) {
  const std::string header = par({{.slice = 1, .place = 0}, {.slice = 2, .place = 1}});
  const auto outcome = [&](std::size_t comments) {
    const std::string head = header.substr(0, header.find("\n.") + 1);
    const std::string more = repeated("# " + std::string(1000, 'x') + '\n', comments);
    return import_bytes(
        zip({{"a.PAR", head + more + header.substr(head.size())}, {"a.REC", kSamples}}));
  };
  const Outcome whole = imported(outcome(2000));
  EXPECT_EQ(whole.canonical, outcome(0).canonical);
  EXPECT_THAT(outcome(8600).error,
              HasSubstr("The PAR header has more than the 8388608 bytes that are supported."));
}

}  // namespace
}  // namespace isomesh::import::test
