#include "server/import/dicom/elements/beginning.h"

#include <cstdint>
#include <string_view>

#include "server/import/dicom/elements/parser.h"
#include "server/import/dicom/elements/tags.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::size_t kPreambleBytes = 128;
constexpr std::string_view kPrefix = "DICM";
constexpr std::string_view kStandardUids = "1.2.840.10008.";

struct LeadingElement {
  Tag tag = 0;
  std::string_view value;
};

std::uint32_t little_endian(std::string_view bytes) {
  std::uint32_t number = 0;
  for (std::size_t at = bytes.size(); at > 0; --at) {
    number = number << 8 | static_cast<unsigned char>(bytes[at - 1]);
  }
  return number;
}

// Removes the first element from `rest`. Two letters in place of an implicit length are always a
// value representation: as a length they would exceed the head.
std::optional<LeadingElement> take_element(std::string_view& rest) {
  constexpr std::size_t kShortHead = 8;
  constexpr std::size_t kLongHead = 12;
  if (rest.size() < kLongHead) return std::nullopt;
  LeadingElement element;
  element.tag = little_endian(rest.substr(0, 2)) << 16 | little_endian(rest.substr(2, 2));
  std::size_t head = kShortHead;
  std::uint32_t length = little_endian(rest.substr(4, 4));
  if (const std::string_view vr = rest.substr(4, 2); is_representation(vr)) {
    head = has_short_length(vr) ? kShortHead : kLongHead;
    length = has_short_length(vr) ? little_endian(rest.substr(6, 2))
                                  : little_endian(rest.substr(kShortHead, 4));
  }
  if (length > rest.size() - head) return std::nullopt;
  element.value = rest.substr(head, length);
  rest.remove_prefix(head + length);
  return element;
}

bool names_a_standard(Tag tag) {
  return tag == kMediaStorageSopClassUid || tag == kTransferSyntaxUid || tag == kSopClassUid;
}

bool begins_with_elements(std::string_view rest) {
  Tag last = 0;
  while (const auto element = take_element(rest)) {
    const unsigned group = element->tag >> 16;
    if (element->tag <= last || (group != 0x0002 && group != 0x0008)) return false;
    if (names_a_standard(element->tag)) return element->value.starts_with(kStandardUids);
    last = element->tag;
  }
  return false;
}

}  // namespace

std::optional<std::size_t> find_beginning(std::span<const std::byte> head) {
  const std::string_view text(reinterpret_cast<const char*>(head.data()), head.size());
  if (text.size() >= kPreambleBytes && text.substr(kPreambleBytes).starts_with(kPrefix)) {
    return kPreambleBytes + kPrefix.size();
  }
  if (begins_with_elements(text)) return 0;
  return std::nullopt;
}

}  // namespace isomesh::import::dicom
