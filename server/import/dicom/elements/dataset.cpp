#include "server/import/dicom/elements/dataset.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "base/text.h"
#include "server/import/dicom/elements/beginning.h"
#include "server/import/dicom/elements/parser.h"
#include "server/import/dicom/elements/tags.h"
#include "server/import/source/gzip.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import::dicom {
namespace {

std::size_t beginning_of(const InputFile& file) {
  const std::string head = file.text(0, kSniffBytes);
  const auto beginning = find_beginning(std::as_bytes(std::span(head)));
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

const DataSet* DataSet::item(Tag sequence) const {
  const Element* element = find(sequence);
  return element == nullptr || element->items.empty() ? nullptr : &element->items.front();
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

std::vector<double> DataSet::numbers(Tag tag) const {
  std::vector<double> result;
  for (const std::string_view part : texts(tag)) {
    const auto number = parse_double(part);
    if (!number || !std::isfinite(*number)) return {};
    result.push_back(*number);
  }
  return result;
}

std::optional<std::int64_t> DataSet::integer(Tag tag) const {
  const auto parts = texts(tag);
  return parts.empty() ? std::nullopt : parse_int64(parts.front());
}

std::optional<std::uint32_t> DataSet::unsigned_number(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr) return std::nullopt;
  const std::string& value = element->value;
  const std::size_t bytes = value.size() >= 4 ? 4 : value.size();
  if (bytes != 2 && bytes != 4) return std::nullopt;
  std::uint32_t number = 0;
  for (std::size_t at = 0; at < bytes; ++at) {
    const auto byte = static_cast<unsigned char>(value[big_endian ? at : bytes - 1 - at]);
    number = number << 8 | byte;
  }
  return number;
}

std::vector<std::uint32_t> DataSet::unsigned_numbers(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr || element->value.size() % 2 != 0) return {};
  std::vector<std::uint32_t> numbers;
  for (std::size_t at = 0; at < element->value.size(); at += 2) {
    const auto first = static_cast<unsigned char>(element->value[at]);
    const auto second = static_cast<unsigned char>(element->value[at + 1]);
    numbers.push_back(big_endian ? first << 8U | second : second << 8U | first);
  }
  return numbers;
}

std::vector<double> DataSet::binary_reals(Tag tag) const {
  const Element* element = find(tag);
  if (element == nullptr || element->value.size() % sizeof(double) != 0) return {};
  std::vector<double> result;
  for (std::size_t at = 0; at < element->value.size(); at += sizeof(double)) {
    std::array<char, sizeof(double)> bytes;
    std::copy_n(element->value.data() + at, bytes.size(), bytes.begin());
    if (big_endian) std::ranges::reverse(bytes);
    result.push_back(std::bit_cast<double>(bytes));
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
  if (!is_gzip(std::as_bytes(std::span(head)))) return file;
  head = file.text(0, kBeginningBytes);
  ScratchFile beginning(scratch, ".beginning");
  const std::string plain = inflate_head(std::as_bytes(std::span(head)), kBeginningBytes);
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

}  // namespace isomesh::import::dicom
