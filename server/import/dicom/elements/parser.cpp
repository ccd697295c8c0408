#include "server/import/dicom/elements/parser.h"

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "base/files.h"
#include "base/text.h"
#include "server/import/dicom/elements/private_elements.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/dicom/elements/text.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

constexpr std::uint32_t kUndefinedLength = 0xFFFFFFFF;
constexpr unsigned kDeepestSequence = 32;
// Bounds on the number of elements, items and fragments, and on the bytes of stored elements.
constexpr std::size_t kMostParts = std::size_t{1} << 21;
constexpr std::size_t kMostKeptBytes = std::size_t{1} << 28;
constexpr std::size_t kWindowBytes = std::size_t{1} << 16;

struct Encoding {
  bool is_explicit = true;
  bool big_endian = false;
};

// An element without its value.
struct Head {
  Tag tag = 0;
  std::string vr;  // empty if implicit
  std::uint32_t length = 0;

  bool has_undefined_length() const { return length == kUndefinedLength; }
};

// The sequences that a volume needs; implicit elements do not declare that they are sequences.
bool is_needed_sequence(Tag tag) {
  switch (tag) {
    case kContourSequence:
    case kDetectorInformationSequence:
    case kFrameContentSequence:
    case kPlaneOrientationVolumeSequence:
    case kPlanePositionVolumeSequence:
    case kReferencedFrameOfReferenceSequence:
    case kRoiContourSequence:
    case kStructureSetRoiSequence:
    case kTemporalPositionSequence:
    case kUsImageDescriptionSequence:
    case kAnatomicRegionSequence:
    case kSegmentedPropertyCategoryCodeSequence:
    case kSegmentedPropertyTypeCodeSequence:
    case kSegmentSequence:
    case kSegmentIdentificationSequence:
    case kMrEchoSequence:
    case kMrDiffusionSequence:
    case kDiffusionGradientSequence:
    case kCardiacSequence:
    case kMrImageFrameTypeSequence:
    case kPlanePositionSequence:
    case kPlaneOrientationSequence:
    case kModalityLutSequence:
    case kPixelMeasuresSequence:
    case kPixelValueTransformationSequence:
    case kRealWorldValueMappingSequence:
    case kSharedFunctionalGroups:
    case kPerFrameFunctionalGroups:
      return true;
    default:
      return false;
  }
}

// The representations with 32-bit lengths (PS3.5, 7.1.2).
bool has_long_length(std::string_view vr) {
  static constexpr std::array<std::string_view, 13> kLong = {
      "OB", "OD", "OF", "OL", "OV", "OW", "SQ", "SV", "UC", "UN", "UR", "UT", "UV"};
  return std::ranges::find(kLong, vr) != kLong.end();
}

// Written by some programs for unknown representations.
bool is_blank(std::string_view vr) {
  return vr == "  " || vr == "??" || vr == std::string_view("\0\0", 2);
}

// The ways to store a length after a tag.
struct LengthPlace {
  unsigned skipped = 0;  // bytes before the length
  unsigned bytes = 0;
};

constexpr LengthPlace kImplicitPlace = {0, 4};
constexpr LengthPlace kShortPlace = {2, 2};
constexpr LengthPlace kLongPlace = {4, 4};

// The places to try for an element whose representation is not in the standard. Most programs write
// a 16-bit length then; others omit the representation, and future ones will have 32-bit lengths.
std::array<LengthPlace, 3> possible_places(std::string_view vr) {
  if (is_representation(vr)) return {kLongPlace, kShortPlace, kImplicitPlace};
  return {kShortPlace, kImplicitPlace, kLongPlace};
}

bool is_palette_data(Tag tag) {
  return (tag >= kRedPaletteData && tag <= kBluePaletteData) ||
         (tag >= kSegmentedRedPaletteData && tag <= kSegmentedBluePaletteData);
}

// Few values are longer than kLongestValue but needed: tables of values and contours.
std::uint64_t longest_value(Tag tag) {
  constexpr std::uint64_t kLongestTable = std::uint64_t{2} << 16;
  constexpr std::uint64_t kLongestContour = std::uint64_t{1} << 26;
  if (tag == kLutData || is_palette_data(tag)) return kLongestTable;
  return tag == kContourData ? kLongestContour : kLongestValue;
}

bool is_pixel_data(Tag tag) {
  return tag == kPixelData || tag == kFloatPixelData || tag == kDoubleFloatPixelData;
}

class Parser {
 public:
  Parser(const InputFile& file, std::uint64_t offset) : file_(file), at_(offset) {}

  std::uint64_t position() const { return at_; }
  std::uint64_t end() const { return file_.size(); }

  MetaInformation meta_information() {
    MetaInformation meta;
    const Encoding encoding;
    while (end() - at_ >= 8 && number(at_, 2, false) == 2) {
      const Head head = read_head(encoding, end());
      const std::string stored = read_value(head, end());
      const std::string value = printable(without_padding(stored));
      if (head.tag == kTransferSyntaxUid) meta.transfer_syntax = value;
      if (head.tag == kMediaStorageSopClassUid) meta.sop_class_uid = value;
      if (head.tag == kMediaStorageSopInstanceUid) meta.sop_instance_uid = value;
    }
    meta.end = at_;
    return meta;
  }

  // True if the next element has an explicit value representation.
  bool looks_explicit() {
    if (end() - at_ < 8) return true;
    return is_representation(window(at_ + 4, 2));
  }

  void read_file(const Encoding& encoding, ParsedFile& result) {
    result.data.big_endian = encoding.big_endian;
    while (at_ < end()) {
      // Media that are read in blocks have zeros or other bytes after the last element.
      if (end() - at_ < 8 || number(at_, 4, encoding.big_endian) == 0) break;
      const Head head = read_head(encoding, end());
      if (is_pixel_data(head.tag)) {
        result.pixels = read_pixels(head, encoding);
        break;
      }
      read_outer_element(head, encoding, result.data);
    }
  }

 private:
  // Returns bytes of the file; the caller has checked the bounds.
  std::string_view window(std::uint64_t offset, std::size_t count) {
    if (offset < window_begin_ || offset + count > window_begin_ + window_.size()) {
      window_ = file_.text(offset, std::max(kWindowBytes, count));
      window_begin_ = offset;
    }
    return std::string_view(window_).substr(offset - window_begin_, count);
  }

  std::uint32_t number(std::uint64_t offset, std::size_t bytes, bool big_endian) {
    const HeaderBytes numbers(window(offset, bytes), big_endian);
    return bytes == 2 ? numbers.at<std::uint16_t>(0) : numbers.at<std::uint32_t>(0);
  }

  Tag read_tag(bool big_endian) {
    const Tag tag = number(at_, 2, big_endian) << 16 | number(at_ + 2, 2, big_endian);
    at_ += 4;
    return tag;
  }

  // Throws unless `limit` is at least `bytes` ahead.
  void require(std::uint64_t bytes, std::uint64_t limit, Tag tag) const {
    if (limit >= at_ && bytes <= limit - at_) return;
    const std::string name = is_pixel_data(tag) ? "pixel data"
                             : tag == 0         ? "data set"
                                                : "element " + tag_name(tag);
    const std::string there = std::to_string(limit > at_ ? limit - at_ : 0);
    throw_unusable("The DICOM file is truncated or corrupt: its " + name + " takes " +
                   std::to_string(bytes) + " bytes, but only " + there + " are left.");
  }

  Head read_head(const Encoding& encoding, std::uint64_t limit) {
    require(8, limit, 0);
    Head head;
    head.tag = read_tag(encoding.big_endian);
    if (!encoding.is_explicit || head.tag >> 16 == kItem >> 16) {
      head.length = number(at_, 4, encoding.big_endian);
      at_ += 4;
      return head;
    }
    head.vr = window(at_, 2);
    if (has_short_length(head.vr)) {
      take_length(kShortPlace, encoding, limit, head);
    } else {
      const bool is_long = has_long_length(head.vr);
      take_length(is_long ? kLongPlace : place_of_length(encoding, limit, head), encoding, limit,
                  head);
    }
    return head;
  }

  void take_length(const LengthPlace& place, const Encoding& encoding, std::uint64_t limit,
                   Head& head) {
    require(place.skipped + place.bytes, limit, head.tag);
    head.length = number(at_ + place.skipped, place.bytes, encoding.big_endian);
    at_ += place.skipped + place.bytes;
  }

  // The first possible place whose length leads to an end, or to an element that may follow.
  LengthPlace place_of_length(const Encoding& encoding, std::uint64_t limit, const Head& head) {
    for (const LengthPlace& place : possible_places(head.vr)) {
      const std::uint64_t value = at_ + place.skipped + place.bytes;
      if (value > limit) continue;
      const std::uint64_t length = number(at_ + place.skipped, place.bytes, encoding.big_endian);
      const bool is_open = length == kUndefinedLength;
      if (!is_open && length > limit - value) continue;
      if (may_follow(is_open ? value : value + length, encoding, limit, head.tag)) return place;
    }
    // The file may be truncated within the value.
    if (is_representation(head.vr) || is_blank(head.vr)) return possible_places(head.vr).front();
    throw_unusable("The DICOM file is corrupt: its element " + tag_name(head.tag) +
                   " has no value representation.");
  }

  bool may_follow(std::uint64_t offset, const Encoding& encoding, std::uint64_t limit, Tag tag) {
    if (offset == limit) return true;
    if (limit - offset < 8) return false;
    const Tag next =
        number(offset, 2, encoding.big_endian) << 16 | number(offset + 2, 2, encoding.big_endian);
    if (next >> 16 == kItem >> 16) return next == kItem || next == kItemEnd || next == kSequenceEnd;
    const std::string_view vr = window(offset + 4, 2);
    return next > tag && (is_pixel_data(next) || next >> 16 <= tag >> 16 || is_representation(vr));
  }

  std::string read_value(const Head& head, std::uint64_t limit,
                         std::uint64_t longest = kLongestValue) {
    require(head.length, limit, head.tag);
    std::string value;
    if (head.length <= longest) value = window(at_, head.length);
    at_ += head.length;
    return value;
  }

  // Throws if there are more parts than any scanner writes; they would exhaust memory.
  void count_part() {
    if (++parts_ <= kMostParts) return;
    throw_unusable("The DICOM file has more than the " + std::to_string(kMostParts) +
                   " elements that are accepted.");
  }

  void keep(DataSet& set, Element element) {
    count_part();
    kept_bytes_ += element.value.size();
    if (kept_bytes_ > kMostKeptBytes) {
      throw_unusable("The DICOM file's elements take more than the " +
                     std::to_string(kMostKeptBytes) + " bytes that are accepted.");
    }
    if (element.tag == kSpecificCharacterSet && !element.value.empty()) {
      set.character_set = std::make_shared<const std::string>(element.value);
    }
    set.elements.push_back(std::move(element));
  }

  // Reads an element of the file's data set, including required private ones.
  void read_outer_element(const Head& head, const Encoding& encoding, DataSet& set) {
    if (!is_private(head.tag)) return read_element(head, encoding, end(), 0, set);
    auto needed = blocks_.needed(head.tag);
    if (!needed && end() - at_ >= 4) needed = blocks_.needed_by_value(head.tag, window(at_, 4));
    Head known = head;
    if (needed) known.tag = *needed;
    Element element = read_content(known, encoding, {end(), 0, set.character_set},
                                   needed ? Meaning::kKnownPrivate : Meaning::kPublic);
    if (needed) return keep(set, std::move(element));
    blocks_.reserve(head.tag, without_padding(element.value));
  }

  void read_element(const Head& head, const Encoding& encoding, std::uint64_t limit, unsigned depth,
                    DataSet& set) {
    if (is_pixel_data(head.tag) && head.has_undefined_length()) {
      read_fragments(encoding, limit);  // an icon's fragments, which are skipped
      return;
    }
    Element element = read_content(head, encoding, {limit, depth, set.character_set});
    if (!is_private(head.tag)) keep(set, std::move(element));
  }

  enum class Meaning { kPublic, kKnownPrivate };

  // The data set around an element's value.
  struct Outside {
    std::uint64_t limit = 0;
    unsigned depth = 0;
    std::shared_ptr<const std::string> character_set;
  };

  Element read_content(const Head& head, const Encoding& encoding, const Outside& outside,
                       Meaning meaning = Meaning::kPublic) {
    Element element;
    element.tag = head.tag;
    const bool is_known = meaning == Meaning::kKnownPrivate;
    const bool is_sequence = head.vr == "SQ" || head.has_undefined_length() ||
                             (is_known ? head.tag == kGridFrames : is_needed_sequence(head.tag));
    if (!is_sequence) {
      element.value = read_value(head, outside.limit,
                                 is_known ? kLongestPrivateValue : longest_value(head.tag));
      return element;
    }
    // Systems that do not know an element store it as UN, with its items in implicit encoding.
    const Encoding inside = head.vr == "UN" ? Encoding{false, false} : encoding;
    read_items(head, inside, {outside.limit, outside.depth + 1, outside.character_set}, element);
    return element;
  }

  void read_items(const Head& head, const Encoding& encoding, const Outside& outside,
                  Element& sequence) {
    if (outside.depth > kDeepestSequence) {
      throw_unusable("The DICOM file is corrupt: its sequences are nested more than " +
                     std::to_string(kDeepestSequence) + " levels deep.");
    }
    const bool has_end = !head.has_undefined_length();
    if (has_end) require(head.length, outside.limit, head.tag);
    const std::uint64_t end = has_end ? at_ + head.length : outside.limit;
    while (!has_end || at_ < end) {
      const Head item = read_head(encoding, end);
      if (item.tag == kSequenceEnd) return;
      if (item.tag != kItem) {
        throw_unusable("The DICOM file is corrupt: its sequence " + tag_name(sequence.tag) +
                       " contains something that is not an item.");
      }
      count_part();
      DataSet set = read_item(item, encoding, {end, outside.depth, outside.character_set});
      if (!is_private(sequence.tag) || sequence.tag == kGridFrames) {
        sequence.items.push_back(std::move(set));
      }
    }
  }

  DataSet read_item(const Head& item, const Encoding& encoding, const Outside& outside) {
    const bool has_end = !item.has_undefined_length();
    if (has_end) require(item.length, outside.limit, kItem);
    const std::uint64_t end = has_end ? at_ + item.length : outside.limit;
    DataSet set;
    set.character_set = outside.character_set;
    set.big_endian = encoding.big_endian;
    while (!has_end || at_ < end) {
      const Head head = read_head(encoding, end);
      if (head.tag == kItemEnd) break;
      read_element(head, encoding, end, outside.depth, set);
    }
    return set;
  }

  PixelElement read_pixels(const Head& head, const Encoding& encoding) {
    PixelElement pixels;
    pixels.tag = head.tag;
    pixels.is_words = head.vr == "OW";
    pixels.is_encapsulated = head.has_undefined_length();
    if (!pixels.is_encapsulated) {
      require(head.length, end(), head.tag);
      pixels.native = {at_, head.length};
      return pixels;
    }
    pixels.fragments = read_fragments(encoding, end());
    if (pixels.fragments.empty()) return pixels;
    const Extent table = pixels.fragments.front();
    pixels.fragments.erase(pixels.fragments.begin());
    for (std::uint64_t at = 0; at + 4 <= table.bytes && at / 4 < kMostParts; at += 4) {
      pixels.frame_offsets.push_back(number(table.offset + at, 4, false));
    }
    return pixels;
  }

  // Reads the fragments of compressed pixels. The first item is a table of offsets.
  std::vector<Extent> read_fragments(const Encoding& encoding, std::uint64_t limit) {
    std::vector<Extent> fragments;
    for (;;) {
      if (at_ == limit) return fragments;  // some writers leave the end out
      const Head item = read_head(encoding, limit);
      if (item.tag == kSequenceEnd) return fragments;
      if (item.tag != kItem || item.has_undefined_length()) {
        throw_unusable("The DICOM file is corrupt: its compressed pixel data is not in items.");
      }
      require(item.length, limit, kPixelData);
      count_part();
      fragments.push_back({at_, item.length});
      at_ += item.length;
    }
  }

  const InputFile& file_;
  std::uint64_t at_;
  std::string window_;
  std::uint64_t window_begin_ = 0;
  PrivateBlocks blocks_;
  std::size_t parts_ = 0;
  std::size_t kept_bytes_ = 0;
};

Encoding encoding_of(Parser& parser, std::string_view transfer_syntax) {
  const bool big_endian = transfer_syntax == kExplicitBigEndian;
  return {big_endian || parser.looks_explicit(), big_endian};
}

}  // namespace

bool is_representation(std::string_view text) {
  const auto is_letter = [](char each) { return each >= 'A' && each <= 'Z'; };
  return text.size() == 2 && is_letter(text[0]) && is_letter(text[1]);
}

bool has_short_length(std::string_view vr) {
  static constexpr std::array<std::string_view, 21> kShort = {
      "AE", "AS", "AT", "CS", "DA", "DS", "DT", "FD", "FL", "IS", "LO",
      "LT", "PN", "SH", "SL", "SS", "ST", "TM", "UI", "UL", "US"};
  return std::find(kShort.begin(), kShort.end(), vr) != kShort.end();
}

MetaInformation parse_meta_information(const InputFile& file, std::uint64_t offset) {
  return Parser(file, offset).meta_information();
}

ParsedFile parse_data_set(const InputFile& file, std::uint64_t offset,
                          std::string_view transfer_syntax) {
  ParsedFile result;
  Parser parser(file, offset);
  parser.read_file(encoding_of(parser, transfer_syntax), result);
  return result;
}

DataSet parse_beginning(const InputFile& file, std::uint64_t offset,
                        std::string_view transfer_syntax) {
  ParsedFile result;
  Parser parser(file, offset);
  try {
    parser.read_file(encoding_of(parser, transfer_syntax), result);
  } catch (const Error& error) {
    // The file may end anywhere. Other errors are found when the whole file is read.
    if (error.code() != ErrorCode::kUnusableVolume) throw;
  }
  return std::move(result.data);
}

}  // namespace isomesh::import::dicom
