#include "server/import/dicom/elements/dataset.h"

#include <algorithm>
#include <cstdint>
#include <string_view>

#include "base/text.h"
#include "server/import/dicom/elements/parser.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/source/gzip.h"
#include "server/import/source/header_fields.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

std::size_t beginning_of(const InputFile& file) {
  const auto beginning = find_beginning(file.text(0, kSniffBytes));
  if (!beginning) throw_unusable("The file is not a DICOM file.");
  return *beginning;
}

void inflate(const InputFile& file, std::uint64_t offset, std::uint64_t limit, Wrapping wrapping,
             ScratchFile& scratch) {
  const std::uint64_t bytes = inflate_range(
      file, {offset, file.size() - offset}, limit,
      [&](std::span<const std::byte> piece) { scratch.write(piece); }, wrapping);
  if (bytes > limit) {
    throw_unusable("The compressed file unpacks to more than the " + std::to_string(limit) +
                   " bytes that its header allows.");
  }
}

void inflate_beginning(const InputFile& file, std::uint64_t offset, ScratchFile& scratch) {
  inflate_range(
      file, {offset, file.size() - offset}, kBeginningBytes,
      [&](std::span<const std::byte> piece) { scratch.write(piece); }, Wrapping::kNone);
}

std::uint64_t most_bytes(const DataSet& data, std::uint64_t most_sample_bytes) {
  constexpr std::uint64_t kMostHeaderBytes = std::uint64_t{1} << 26;
  constexpr std::uint64_t kMostOfOthers = std::uint64_t{1} << 28;
  const auto number = [&](Tag tag) -> double { return data.unsigned_number(tag).value_or(0); };
  const auto frames = static_cast<double>(data.integer(kNumberOfFrames).value_or(1));
  const double bytes =
      number(kRows) * number(kColumns) * number(kBitsAllocated) / 8 * std::max(frames, 1.0);
  if (bytes == 0) return kMostOfOthers;
  const auto most = static_cast<double>(most_sample_bytes);
  return kMostHeaderBytes + static_cast<std::uint64_t>(std::min(bytes * 2, most));
}

constexpr std::size_t kPreambleBytes = 128;
constexpr std::string_view kPrefix = "DICM";
constexpr std::string_view kStandardUids = "1.2.840.10008.";

struct LeadingElement {
  Tag tag = 0;
  std::string_view value;
};

// Removes the first element from `rest`. Two letters in place of an implicit length are always a
// value representation: as a length they would exceed the head.
std::optional<LeadingElement> take_element(std::string_view& rest) {
  constexpr std::size_t kShortHead = 8;
  constexpr std::size_t kLongHead = 12;
  if (rest.size() < kLongHead) return std::nullopt;
  const HeaderBytes numbers(rest, false);
  LeadingElement element;
  element.tag = std::uint32_t{numbers.at<std::uint16_t>(0)} << 16 | numbers.at<std::uint16_t>(2);
  std::size_t head = kShortHead;
  auto length = numbers.at<std::uint32_t>(4);
  if (const std::string_view vr = rest.substr(4, 2); is_representation(vr)) {
    head = has_short_length(vr) ? kShortHead : kLongHead;
    length =
        has_short_length(vr) ? numbers.at<std::uint16_t>(6) : numbers.at<std::uint32_t>(kShortHead);
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

std::string tag_name(Tag tag) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  std::string text = "(";
  for (int shift = 28; shift >= 0; shift -= 4) {
    text += kDigits[tag >> shift & 0xFU];
    if (shift == 16) text += ',';
  }
  return text + ')';
}

std::string_view without_padding(std::string_view value) {
  constexpr std::string_view kPadding(" \0", 2);
  const std::size_t first = value.find_first_not_of(' ');
  const std::size_t last = value.find_last_not_of(kPadding);
  if (first == value.npos || last == value.npos || first > last) return {};
  return value.substr(first, last - first + 1);
}

const Element* DataSet::find(Tag tag) const {
  const auto found = std::find_if(elements.begin(), elements.end(),
                                  [&](const Element& element) { return element.tag == tag; });
  return found == elements.end() ? nullptr : &*found;
}

std::span<const DataSet> DataSet::items(Tag sequence) const {
  const Element* element = find(sequence);
  return element == nullptr ? std::span<const DataSet>() : element->items;
}

const DataSet* DataSet::item(Tag sequence) const {
  const auto all = items(sequence);
  return all.empty() ? nullptr : &all.front();
}

std::string_view DataSet::text(Tag tag) const {
  const Element* element = find(tag);
  return element == nullptr ? std::string_view{} : without_padding(element->value);
}

std::vector<std::string_view> DataSet::texts(Tag tag) const {
  std::vector<std::string_view> parts;
  std::string_view rest = text(tag);
  if (rest.empty()) return parts;
  for (;;) {
    const std::size_t end = rest.find('\\');
    parts.push_back(without_padding(rest.substr(0, end)));
    if (end == rest.npos) return parts;
    rest.remove_prefix(end + 1);
  }
}

std::vector<double> DataSet::numbers(Tag tag) const { return finite_numbers_of(texts(tag)); }

std::optional<std::int64_t> DataSet::integer(Tag tag) const {
  const auto parts = texts(tag);
  return parts.empty() ? std::nullopt : parse_int64(parts.front());
}

std::optional<std::uint32_t> DataSet::unsigned_number(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr) return std::nullopt;
  const HeaderBytes value(element->value, big_endian);
  if (element->value.size() >= 4) return value.at<std::uint32_t>(0);
  if (element->value.size() == 2) return value.at<std::uint16_t>(0);
  return std::nullopt;
}

std::vector<std::uint32_t> DataSet::unsigned_numbers(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr || element->value.size() % 2 != 0) return {};
  const HeaderBytes value(element->value, big_endian);
  std::vector<std::uint32_t> numbers;
  for (std::size_t at = 0; at < element->value.size(); at += 2) {
    numbers.push_back(value.at<std::uint16_t>(at));
  }
  return numbers;
}

std::vector<double> DataSet::binary_reals(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr || element->value.size() % sizeof(double) != 0) return {};
  const HeaderBytes value(element->value, big_endian);
  std::vector<double> result;
  for (std::size_t at = 0; at < element->value.size(); at += sizeof(double)) {
    result.push_back(value.at<double>(at));
  }
  return result;
}

std::uint64_t most_file_bytes(const InputFile& beginning, const std::filesystem::path& scratch,
                              std::uint64_t most_sample_bytes) {
  try {
    const MetaInformation meta = parse_meta_information(beginning, beginning_of(beginning));
    if (meta.transfer_syntax != kDeflated) {
      return most_bytes(parse_beginning(beginning, meta.end, meta.transfer_syntax),
                        most_sample_bytes);
    }
    // The deflated file is smaller than that.
    ScratchFile inflated(scratch, ".beginning");
    inflate_beginning(beginning, meta.end, inflated);
    return most_bytes(parse_beginning(InputFile(inflated.path()), 0, meta.transfer_syntax),
                      most_sample_bytes);
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return most_bytes({}, most_sample_bytes);
  }
}

namespace {

// The file itself, or its inflated copy, which gets a place in `scratch`.
InputFile plain_file(const std::filesystem::path& path, const std::filesystem::path& scratch,
                     std::uint64_t most_sample_bytes, std::optional<ScratchFile>& copy) {
  InputFile file(path);
  std::string head = file.text(0, kSniffBytes);
  if (!is_gzip(head)) return file;
  head = file.text(0, kBeginningBytes);
  ScratchFile beginning(scratch, ".beginning");
  const std::string plain = inflate_head(head, kBeginningBytes);
  beginning.write(std::as_bytes(std::span(plain)));
  copy.emplace(scratch, ".plain");
  inflate(file, 0, most_file_bytes(InputFile(beginning.path()), scratch, most_sample_bytes),
          Wrapping::kZlibOrGzip, *copy);
  return InputFile(copy->path());
}

}  // namespace

DicomFile::DicomFile(const std::filesystem::path& path, const std::filesystem::path& scratch,
                     std::uint64_t most_sample_bytes)
    : file_(plain_file(path, scratch, most_sample_bytes, plain_)),
      meta_(parse_meta_information(file_, beginning_of(file_))) {
  std::uint64_t begin = meta_.end;
  if (transfer_syntax() == kDeflated) {
    scratch_.emplace(scratch, ".inflated");
    inflate(file_, begin, most_file_bytes(file_, scratch, most_sample_bytes), Wrapping::kNone,
            *scratch_);
    inflated_.emplace(scratch_->path());
    begin = 0;
  }
  ParsedFile parsed = parse_data_set(bytes(), begin, transfer_syntax());
  data_ = std::move(parsed.data);
  pixels_ = std::move(parsed.pixels);
}

std::optional<std::size_t> find_beginning(std::string_view head) {
  if (head.size() >= kPreambleBytes && head.substr(kPreambleBytes).starts_with(kPrefix)) {
    return kPreambleBytes + kPrefix.size();
  }
  if (begins_with_elements(head)) return 0;
  return std::nullopt;
}

}  // namespace isomesh::import::dicom
