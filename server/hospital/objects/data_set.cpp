#include "server/hospital/objects/data_set.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "base/error.h"
#include "server/hospital/objects/uid.h"

namespace isomesh::dicom {
namespace {

void append_number(std::uint32_t number, int bytes, std::string& text) {
  for (int byte = 0; byte < bytes; ++byte) {
    text += static_cast<char>((number >> (8 * byte)) & 0xff);
  }
}

void append_tag(Tag tag, std::string& text) {
  append_number(tag >> 16, 2, text);
  append_number(tag & 0xffff, 2, text);
}

// Value representations with a 32-bit length.
bool is_long(std::string_view vr) {
  constexpr std::array<std::string_view, 6> kLong = {"OB", "OW", "SQ", "UN", "UR", "UT"};
  return std::ranges::find(kLong, vr) != kLong.end();
}

// A length that is cut would make bytes of the value look like the elements after it.
void check_length(Tag tag, std::uint64_t bytes, bool has_long_length) {
  constexpr std::uint64_t kMostShort = 0xFFFE;
  constexpr std::uint64_t kMostLong = 0xFFFFFFFE;
  const std::uint64_t most = has_long_length ? kMostLong : kMostShort;
  if (bytes <= most) return;
  std::array<char, 16> name = {};
  std::snprintf(name.data(), name.size(), "(%04X,%04X)", tag >> 16, tag & 0xffff);
  throw Error(ErrorCode::kTooLarge, std::string("the attribute ") + name.data() +
                                        " of the object would have " + std::to_string(bytes) +
                                        " bytes, but can have at most " + std::to_string(most));
}

}  // namespace

std::string element_head(Tag tag, std::string_view vr, std::uint64_t bytes) {
  check_length(tag, bytes, is_long(vr));
  const auto length = static_cast<std::uint32_t>(bytes);
  std::string head;
  append_tag(tag, head);
  head += vr;
  if (is_long(vr)) {
    append_number(0, 2, head);
    append_number(length, 4, head);
  } else {
    append_number(length, 2, head);
  }
  return head;
}

void DataSet::set(Tag tag, std::string_view vr, std::string_view text) {
  Element& element = elements_[tag];
  element.vr = vr;
  element.value = text;
  if (text.size() % 2 != 0) element.value += vr == "UI" ? '\0' : ' ';
}

void DataSet::set_told(Tag tag, std::string_view vr, std::string_view text) {
  if (!text.empty()) set(tag, vr, text);
}

void DataSet::set_long(Tag tag, std::uint32_t number) {
  std::string value;
  append_number(number, 4, value);
  set_bytes(tag, "UL", value);
}

void DataSet::set_bytes(Tag tag, std::string_view vr, std::string_view bytes) {
  elements_[tag] = {std::string(vr), std::string(bytes)};
}

void DataSet::append_item(const DataSet& item, std::string& bytes) {
  constexpr Tag kItem = 0xFFFEE000;
  const std::string content = item.bytes();
  check_length(kItem, content.size(), true);
  append_tag(kItem, bytes);
  append_number(static_cast<std::uint32_t>(content.size()), 4, bytes);
  bytes += content;
}

void DataSet::set_sequence(Tag tag, const std::vector<DataSet>& items) {
  std::string value;
  for (const DataSet& item : items) append_item(item, value);
  elements_[tag] = {"SQ", value};
}

void DataSet::append(Tag tag, const Element& element, std::string& bytes) {
  bytes += element_head(tag, element.vr, element.value.size());
  bytes += element.value;
}

std::string DataSet::bytes() const {
  std::string bytes;
  for (const auto& [tag, element] : elements_) append(tag, element, bytes);
  return bytes;
}

std::string DataSet::bytes_before(Tag tag) const {
  std::string bytes;
  for (auto each = elements_.begin(); each != elements_.lower_bound(tag); ++each) {
    append(each->first, each->second, bytes);
  }
  return bytes;
}

std::string DataSet::bytes_after(Tag tag) const {
  std::string bytes;
  for (auto each = elements_.upper_bound(tag); each != elements_.end(); ++each) {
    append(each->first, each->second, bytes);
  }
  return bytes;
}

std::string file_head(std::string_view sop_class, std::string_view instance,
                      std::string_view transfer_syntax) {
  DataSet meta;
  meta.set_bytes(0x00020001, "OB", std::string_view("\0\1", 2));
  meta.set(0x00020002, "UI", sop_class);
  meta.set(0x00020003, "UI", instance);
  meta.set(0x00020010, "UI", transfer_syntax);
  meta.set(0x00020012, "UI", name_based_uid("implementation"));
  meta.set(0x00020013, "SH", "ISOMESH " ISOMESH_VERSION);
  const std::string rest = meta.bytes();
  DataSet length;
  length.set_long(0x00020000, static_cast<std::uint32_t>(rest.size()));
  constexpr std::size_t kPreamble = 128;
  return std::string(kPreamble, '\0') + "DICM" + length.bytes() + rest;
}

}  // namespace isomesh::dicom
