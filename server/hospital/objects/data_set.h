// Data sets to be written, in Explicit VR Little Endian (PS3.5, 7).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::dicom {

// Group and element: 0x00280010 is (0028,0010).
using Tag = std::uint32_t;

// Elements by their tags, so that they are written in the order that DICOM asks for, whatever the
// order they were set in. Values are bytes as they go into the file, in UTF-8 where they are texts;
// whoever sets them keeps to what the value representation allows.
class DataSet {
 public:
  // A text, padded to an even length; several values have backslashes between.
  void set(Tag tag, std::string_view vr, std::string_view text);
  // Only where there is something to say.
  void set_told(Tag tag, std::string_view vr, std::string_view text);
  void set_long(Tag tag, std::uint32_t number);                          // UL
  void set_bytes(Tag tag, std::string_view vr, std::string_view bytes);  // of an even number
  void set_sequence(Tag tag, const std::vector<DataSet>& items);

  // All elements; those before `tag`, and those after it.
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

// What stands before the value of an element of so many bytes, an even number below 2^32 - 1.
std::string element_head(Tag tag, std::string_view vr, std::uint32_t bytes);

}  // namespace isomesh::dicom
