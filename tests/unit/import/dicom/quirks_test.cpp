// Tests of non-standard DICOM that some programs write.
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "server/import/dicom/elements/tags.h"
#include "tests/unit/import/dicom/objects.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using namespace dicom;
using testing::HasSubstr;

TEST(DicomFiles, MayHaveBlankRepresentations) {
  const DicomSeries series;
  for (const std::string_view blank : {std::string_view("  "), std::string_view("\0\0", 2)}) {
    const NamedFiles files = changed(series, [&](DicomObject& object) {
      object.bytes(kPixelPaddingValue, blank, "ab").bytes(0x00200010, blank, "");
    });
    EXPECT_EQ(import_objects(files).canonical, import_objects(series.files()).canonical);
  }
}

// Representations that the standard does not have, before a length in any place.
TEST(DicomFiles, MayHaveUnknownRepresentations) {
  const DicomSeries series;
  const std::string expected = import_objects(series.files()).canonical;
  const std::string padding("\x28\0\x20\x01", 4);  // (0028,0120)
  const std::string plain = padding + std::string("US\x02\0ab", 6);
  for (const std::string_view odd :
       {std::string_view("??\2\0ab", 6), std::string_view("ox\2\0ab", 6),
        std::string_view("XY\2\0ab", 6), std::string_view("\2\0\0\0ab", 6),
        std::string_view("xs\0\0\2\0\0\0ab", 10), std::string_view("ZZ\0\0\2\0\0\0ab", 10)}) {
    NamedFiles files =
        changed(series, [](DicomObject& object) { object.bytes(kPixelPaddingValue, "US", "ab"); });
    for (auto& [name, file] : files) {
      file.replace(file.find(plain), plain.size(), padding + std::string(odd));
    }
    const Outcome outcome = import_objects(files);
    EXPECT_EQ(outcome.error, "") << odd;
    EXPECT_EQ(outcome.canonical, expected) << odd;
  }
}

// Deflated files, each changed, as an import of them.
Outcome import_deflated(const std::function<void(std::string&, const std::string&)>& change) {
  const DicomSeries series;
  NamedFiles files;
  for (std::uint32_t k = 0; k < series.slices; ++k) {
    std::string file = series.slice(k).file(kDeflate);
    change(file, series.slice(k).bare());
    files.emplace_back("F" + std::to_string(k), file);
  }
  return import_objects(files);
}

std::string trailer_of(const std::string& data) {
  const auto* bytes = reinterpret_cast<const unsigned char*>(data.data());
  const auto size = static_cast<std::uint32_t>(data.size());
  return bytes_of(std::vector{static_cast<std::uint32_t>(crc32(0, bytes, size)), size});
}

TEST(DicomFiles, MayHaveAChecksumBehindDeflatedData) {
  const std::string expected = import_objects(DicomSeries{}.files()).canonical;
  const Outcome plain = import_deflated([](std::string&, const std::string&) {});
  EXPECT_EQ(plain.canonical, expected);
  const Outcome checked =
      import_deflated([](std::string& file, const std::string& data) { file += trailer_of(data); });
  EXPECT_EQ(checked.canonical, expected);
  const Outcome padded = import_deflated([](std::string& file, const std::string& data) {
    file += '\0' + trailer_of(data) + std::string(20, '\0');
  });
  EXPECT_EQ(padded.canonical, expected);
  const Outcome wrong = import_deflated([](std::string& file, const std::string& data) {
    std::string trailer = trailer_of(data);
    trailer[1] = static_cast<char>(trailer[1] + 1);
    file += trailer;
  });
  EXPECT_THAT(wrong.error, HasSubstr("followed by data that is not part of it"));
  const Outcome more = import_deflated(
      [](std::string& file, const std::string& data) { file += trailer_of(data) + "x"; });
  EXPECT_THAT(more.error, HasSubstr("followed by data that is not part of it"));
}

}  // namespace
}  // namespace isomesh::import::test
