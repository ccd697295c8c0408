// The structure of a DICOM file: its elements, checked against the bytes that are there.
//
// GDCM's reader allocates whatever a length says and follows sequences to any depth, so elements
// are read by ourselves, and GDCM is given only pixel data that has been checked (decode.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"

namespace isomesh::import::dicom {

// Group and element: 0x00280010 is (0028,0010).
using Tag = std::uint32_t;

std::string tag_name(Tag tag);  // "(0028,0010)"

// Values are padded to an even length by a space, those of identifiers by a zero.
std::string_view without_padding(std::string_view value);

class DataSet;

struct Element {
  Tag tag = 0;
  std::string value;           // as stored; empty when it is longer than kLongestValue
  std::vector<DataSet> items;  // of a sequence
};

// Longer values are not read, because no volume needs one.
inline constexpr std::uint64_t kLongestValue = 4096;

// The elements of a file or of one item of a sequence, without private ones but for those of
// private_elements.h.
class DataSet {
 public:
  std::vector<Element> elements;
  bool big_endian = false;

  // The first with this tag, or null.
  const Element* find(Tag tag) const;

  // The first item of a sequence, or null.
  const DataSet* item(Tag sequence) const;

  // The value without its padding; empty when there is none.
  std::string_view text(Tag tag) const;

  // The parts of a text between backslashes, without spaces around them.
  std::vector<std::string_view> texts(Tag tag) const;

  // Decimal strings. Empty when there is no value or one that is no list of finite numbers.
  std::vector<double> numbers(Tag tag) const;
  std::optional<std::int64_t> integer(Tag tag) const;

  // Binary numbers of 16 (US) or 32 bits (UL).
  std::optional<std::uint32_t> unsigned_number(Tag tag) const;

  // Binary numbers of 16 bits (US). Empty when there are none.
  std::vector<std::uint32_t> unsigned_numbers(Tag tag) const;

  // Binary numbers of double precision (FD). Empty when there are none.
  std::vector<double> binary_reals(Tag tag) const;
};

// A run of bytes in a file.
struct Extent {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

// Where the pixels lie.
struct PixelElement {
  Tag tag = 0;
  bool is_words = false;  // OW rather than OB: bytes of big-endian files are swapped in pairs
  Extent native;          // not used when encapsulated
  bool is_encapsulated = false;
  std::vector<Extent> fragments;
  std::vector<std::uint64_t> frame_offsets;  // the basic offset table, which may be empty
};

// The group 0002, which comes before a file's data set.
struct MetaInformation {
  std::string transfer_syntax;  // empty when none is told
  std::string sop_class_uid;
  std::string sop_instance_uid;
  std::uint64_t end = 0;  // where the data set begins
};

// How many bytes a file may have that begins so: of its image, twice what its rows, columns, frames
// and bits take, since compression may make them more, beside headers; of another object, or where
// the beginning does not tell, some hundred million. A deflated file's inflated beginning is put
// into `scratch`. Never throws because of the bytes.
std::uint64_t most_file_bytes(const InputFile& beginning, const std::filesystem::path& scratch,
                              std::uint64_t most_sample_bytes);

// One DICOM file. Immutable.
class DicomFile {
 public:
  // Reads up to the pixels. A deflated file is inflated into `scratch`, up to what its beginning
  // tells (most_file_bytes). Throws Error kUnusableVolume when the file is truncated, corrupt or of
  // a transfer syntax that is not known.
  DicomFile(const std::filesystem::path& path, const std::filesystem::path& scratch,
            std::uint64_t most_sample_bytes);

  // The file that the offsets of `pixels` count from: this one, or what it was inflated to.
  const InputFile& bytes() const { return inflated_ ? *inflated_ : file_; }
  const MetaInformation& meta() const { return meta_; }
  const std::string& transfer_syntax() const { return meta_.transfer_syntax; }
  const DataSet& data() const { return data_; }
  const std::optional<PixelElement>& pixels() const { return pixels_; }

 private:
  InputFile file_;
  std::optional<ScratchFile> scratch_;
  std::optional<InputFile> inflated_;
  MetaInformation meta_;
  DataSet data_;
  std::optional<PixelElement> pixels_;
};

}  // namespace isomesh::import::dicom
