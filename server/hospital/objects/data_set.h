// Writes DICOM files: their heads, and data sets in Explicit VR Little Endian (PS3.5, 7).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::dicom {

// Group and element: 0x00280010 is (0028,0010).
using Tag = std::uint32_t;

// Elements by tag, so they are written in ascending order as DICOM requires, whatever the order of
// the calls. Values are bytes as in the file; texts are UTF-8. The caller ensures that values are
// valid for their value representation. What writes bytes throws Error kTooLarge, with the tag, for
// a value that is longer than its element can be.
class DataSet {
 public:
  // Sets a text, padded to an even length; backslashes separate several values.
  void set(Tag tag, std::string_view vr, std::string_view text);
  // As set(), but skips an empty text.
  void set_told(Tag tag, std::string_view vr, std::string_view text);
  void set_long(Tag tag, std::uint32_t number);                          // UL
  void set_bytes(Tag tag, std::string_view vr, std::string_view bytes);  // an even number of bytes
  void set_sequence(Tag tag, const std::vector<DataSet>& items);
  // Appends an item of a sequence to its bytes, for sequences that are too long for a vector.
  static void append_item(const DataSet& item, std::string& bytes);

  // All elements; or those before `tag`, or those after it.
  std::string bytes() const;
  std::string bytes_before(Tag tag) const;
  std::string bytes_after(Tag tag) const;

 private:
  struct Element {
    std::string vr;
    std::string value;
  };
  static void append(Tag tag, const Element& element, std::string& bytes);

  std::map<Tag, Element> elements_;
};

// The header of an element whose value has `bytes` bytes, an even number. Throws Error kTooLarge if
// that is more than an element of that value representation can have.
std::string element_head(Tag tag, std::string_view vr, std::uint64_t bytes);

// The part of a DICOM file before its data set (PS3.10, 7.1): preamble, prefix and file meta
// information. Pure function.
std::string file_head(std::string_view sop_class, std::string_view instance,
                      std::string_view transfer_syntax);

}  // namespace isomesh::dicom
