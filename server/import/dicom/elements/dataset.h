// The elements of a DICOM file, checked against the file's size.
//
// GDCM's reader takes truncated files for complete ones (docs/decisions/dicom-parser.md). So this
// parser reads the elements, and GDCM gets only checked pixel data (decode.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"

namespace isomesh::import::dicom {

// (group << 16) | element: 0x00280010 is (0028,0010).
using Tag = std::uint32_t;

std::string tag_name(Tag tag);  // "(0028,0010)"

// Removes the padding to an even length: a space, or a zero in identifiers.
std::string_view without_padding(std::string_view value);

class DataSet;

struct Element {
  Tag tag = 0;
  std::string value;           // as stored; empty if longer than kLongestValue
  std::vector<DataSet> items;  // of a sequence
};

// Longer values are skipped; no volume needs them.
inline constexpr std::uint64_t kLongestValue = 4096;

// The elements of a file or of a sequence item. Of private ones only those of private_elements.h.
class DataSet {
 public:
  std::vector<Element> elements;
  bool big_endian = false;
  // The Specific Character Set, which items without one have from the data set around them
  // (PS3.5, 7.5.3). Null if no set is declared. The parser sets it; utf8() of text.h reads it.
  std::shared_ptr<const std::string> character_set;

  // Returns the first element with this tag, or null.
  const Element* find(Tag tag) const;

  // The items of a sequence; empty if it is missing.
  std::span<const DataSet> items(Tag sequence) const;

  // Returns the first item of a sequence, or null.
  const DataSet* item(Tag sequence) const;

  // The value without its padding; empty if missing.
  std::string_view text(Tag tag) const;

  // The parts of a text between backslashes, trimmed.
  std::vector<std::string_view> texts(Tag tag) const;

  // Decimal strings. Empty if the value is missing or not a list of finite numbers.
  std::vector<double> numbers(Tag tag) const;
  std::optional<std::int64_t> integer(Tag tag) const;

  // Binary numbers of 16 (US) or 32 bits (UL).
  std::optional<std::uint32_t> unsigned_number(Tag tag) const;

  // Binary numbers of 16 bits (US). Empty if missing.
  std::vector<std::uint32_t> unsigned_numbers(Tag tag) const;

  // Binary numbers of double precision (FD). Empty if missing.
  std::vector<double> binary_reals(Tag tag) const;
};

struct Extent {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
};

struct PixelElement {
  Tag tag = 0;
  bool is_words = false;  // OW, not OB: big-endian files have swapped pairs of bytes
  Extent native;          // unused if encapsulated
  bool is_encapsulated = false;
  std::vector<Extent> fragments;
  std::vector<std::uint64_t> frame_offsets;  // the basic offset table; may be empty
};

// Group 0002, before a file's data set.
struct MetaInformation {
  std::string transfer_syntax;  // empty if missing
  std::string sop_class_uid;
  std::string sop_instance_uid;
  std::uint64_t end = 0;  // the start of the data set
};

// The largest possible size of a file with this beginning. For an image: twice the size by its
// rows, columns, frames and bits, because compression may enlarge it, and the headers. For other
// objects, and without that information, about 268 MB. The inflated beginning of a deflated file is
// written to `scratch`. Never throws because of the bytes.
std::uint64_t most_file_bytes(const InputFile& beginning, const std::filesystem::path& scratch,
                              std::uint64_t most_sample_bytes);

// One DICOM file. Immutable.
class DicomFile {
 public:
  // Reads up to the pixels. Inflates a gzipped or deflated file into `scratch`, up to
  // most_file_bytes of its beginning. Throws Error kUnusableVolume if the file is truncated or
  // corrupt, or its transfer syntax is unknown.
  DicomFile(const std::filesystem::path& path, const std::filesystem::path& scratch,
            std::uint64_t most_sample_bytes);

  // The file that the offsets of `pixels` refer to: this one, or its inflated copy.
  const InputFile& bytes() const { return inflated_ ? *inflated_ : file_; }
  const MetaInformation& meta() const { return meta_; }
  const std::string& transfer_syntax() const { return meta_.transfer_syntax; }
  const DataSet& data() const { return data_; }
  const std::optional<PixelElement>& pixels() const { return pixels_; }

 private:
  std::optional<ScratchFile> plain_;  // of a gzipped file
  InputFile file_;
  std::optional<ScratchFile> scratch_;
  std::optional<InputFile> inflated_;
  MetaInformation meta_;
  DataSet data_;
  std::optional<PixelElement> pixels_;
};

// The number of bytes before a file's first element. Most files have a preamble of 128 bytes and
// "DICM" (PS3.10). Older files, and those of some programs, have none. They are recognised by
// elements of the groups 0002 and 0008 in ascending order, up to a SOP class or transfer syntax of
// the standard. Empty if `head`, a file's first bytes, is neither. Thread safe.
std::optional<std::size_t> find_beginning(std::string_view head);

}  // namespace isomesh::import::dicom
