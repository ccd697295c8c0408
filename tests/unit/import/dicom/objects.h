// DICOM files as scanners write them, and as nobody should.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <gmock/gmock.h>

#include "server/import/dicom/geometry/image.h"
#include "tests/unit/import/files.h"

namespace isomesh::import::test {

inline constexpr std::string_view kImplicit = "1.2.840.10008.1.2";
inline constexpr std::string_view kExplicit = "1.2.840.10008.1.2.1";
inline constexpr std::string_view kDeflate = "1.2.840.10008.1.2.1.99";
inline constexpr std::string_view kBigEndian = "1.2.840.10008.1.2.2";

// A data set that is written element by element in the order of tags.
class DicomObject {
 public:
  DicomObject& text(dicom::Tag tag, std::string_view vr, std::string_view value);
  DicomObject& number(dicom::Tag tag, unsigned value);                          // US
  DicomObject& numbers(dicom::Tag tag, const std::array<unsigned, 3>& values);  // US
  DicomObject& bytes(dicom::Tag tag, std::string_view vr, std::string value);   // as they are
  DicomObject& items(dicom::Tag tag, std::vector<DicomObject> items);
  // Native samples: little-endian words of `bytes_per_word`, turned around where the syntax asks.
  DicomObject& pixels(std::string bytes, unsigned bytes_per_word);
  // Compressed samples, one fragment each. With `offsets` the table tells where frames begin.
  DicomObject& fragments(std::vector<std::string> fragments, std::vector<std::uint32_t> offsets);
  DicomObject& erase(dicom::Tag tag);

  // The whole file. Sequences are of undefined length in explicit syntaxes, of defined in others.
  std::string file(std::string_view transfer_syntax = kExplicit) const;
  // The same without preamble and meta information.
  std::string bare(std::string_view transfer_syntax = kExplicit) const;

 private:
  struct Value {
    std::string vr;
    std::string bytes;
    unsigned bytes_per_word = 1;
    std::vector<DicomObject> items;
    bool is_encapsulated = false;
    std::vector<std::string> fragments;
    std::vector<std::uint32_t> offsets;
  };

  std::string data_set(bool is_explicit, bool big_endian) const;
  static std::string element(dicom::Tag tag, const Value& value, bool is_explicit, bool big_endian);

  std::map<dicom::Tag, Value> values_;
};

// A series of slices in a file each, or all in one.
struct DicomSeries {
  std::uint32_t columns = 5;
  std::uint32_t rows = 4;
  std::uint32_t slices = 6;
  Vector3 origin = {-10, 20, 30};
  Vector3 along_row = {1, 0, 0};
  Vector3 along_column = {0, 1, 0};
  Vector3 step = {0, 0, 2.5};
  double between_rows = 0.5;
  double between_columns = 0.75;
  unsigned bits_allocated = 16;
  unsigned bits_stored = 12;
  unsigned high_bit = 11;
  bool is_signed = false;
  bool is_smooth = false;  // GDCM cannot encode what becomes larger: it writes beyond its buffer
  std::string uid = "1.2.3.4";
  std::string syntax = std::string(kExplicit);

  dicom::PixelLayout layout() const {
    return {columns, rows, bits_allocated, bits_stored, high_bit, is_signed};
  }

  // The stored value of a sample, the same in every run.
  std::int64_t stored(std::uint32_t i, std::uint32_t j, std::uint32_t k) const;

  Vector3 position(std::uint32_t slice) const;
  std::string native_bytes(std::uint32_t slice) const;

  // One slice: a CT image of a file of its own.
  DicomObject slice(std::uint32_t number) const;
  // All slices in one file, as Enhanced CT and MR have them, in the order that `order` gives.
  DicomObject enhanced(const std::vector<std::uint32_t>& order) const;

  // Files in an order and with names that tell nothing.
  std::vector<std::pair<std::string, std::string>> files() const;
};

using NamedFiles = std::vector<std::pair<std::string, std::string>>;

// The slices in their order, from "IM1" on, each as a function leaves it.
NamedFiles changed(const DicomSeries& series,
                   const std::function<void(DicomObject&, std::uint32_t slice)>& change);
NamedFiles changed(const DicomSeries& series, const std::function<void(DicomObject&)>& change);

// An item of functional groups with the position of a frame, and one that all frames share.
DicomObject frame_at(const Vector3& position);
DicomObject shared_groups(const std::string& spacing = "0.5\\0.75",
                          const std::string& orientation = "1\\0\\0\\0\\1\\0");

// One frame's native bytes compressed by GDCM. JPEG, JPEG-LS, JPEG 2000 and RLE.
std::string compressed(std::string_view transfer_syntax, const dicom::PixelLayout& layout,
                       const std::string& native);

// Imports files by names and bytes as import_dicom does; scratch files that are left are an error.
Outcome import_objects(const NamedFiles& files, const ImportOptions& options = {},
                       const SizeLimits& limits = {});

// A choice, whatever tells its series apart.
MATCHER_P3(IsChoice, parameter, value, title, "") {
  return arg.parameter == parameter && arg.value == value && arg.title == title;
}

// The detail of the volume's note of that code; empty when there is none.
std::string note_detail(const Outcome& outcome, NoteCode code);

}  // namespace isomesh::import::test
