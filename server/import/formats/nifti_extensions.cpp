#include "server/import/formats/nifti_extensions.h"

#include <algorithm>
#include <string>
#include <string_view>
#include <utility>

#include "server/import/labels/label_table.h"
#include "server/import/labels/label_xml.h"

namespace isomesh::import {
namespace {

// Room for 65 535 labels with long names; the rest is ignored.
constexpr std::uint64_t kMostExtensionBytes = std::uint64_t{16} << 20;
constexpr std::size_t kFlagBytes = 4;  // the first tells whether there are extensions
constexpr std::size_t kHeadBytes = 8;  // size and code

std::uint32_t number_at(std::string_view bytes, std::size_t at, bool big_endian) {
  std::uint32_t number = 0;
  for (std::size_t byte = 0; byte < 4; ++byte) {
    const auto value = static_cast<unsigned char>(bytes[at + (big_endian ? byte : 3 - byte)]);
    number = number << 8U | value;
  }
  return number;
}

std::string_view text_of(std::string_view data) { return data.substr(0, data.find('\0')); }

bool may_have_labels(std::string_view text) {
  return text.find("LabelTable") != text.npos || text.find("VALUE_LABEL_DTABLE") != text.npos;
}

}  // namespace

std::vector<LabelEntry> nifti_labels(const InputFile& file, const NiftiHeader& header,
                                     std::uint64_t end, std::uint64_t volume) {
  const auto begin = static_cast<std::uint64_t>(header.bytes);
  if (header.is_analyze || end < begin + kFlagBytes + kHeadBytes) return {};
  const std::string bytes = file.text(begin, std::min(end - begin, kMostExtensionBytes));
  if (bytes.size() < kFlagBytes || bytes[0] == '\0') return {};
  std::string_view rest = std::string_view(bytes).substr(kFlagBytes);
  std::vector<LabelEntry> entries;
  while (rest.size() >= kHeadBytes) {
    const std::uint32_t size = number_at(rest, 0, header.big_endian);
    if (size < kHeadBytes || size > rest.size()) break;
    // Recognised by content, not by code: some programs write Caret's as a comment, or without a
    // code.
    const std::string_view text = text_of(rest.substr(kHeadBytes, size - kHeadBytes));
    if (may_have_labels(text)) {
      for (LabelEntry& entry : labels_of_xml(text, volume)) entries.push_back(std::move(entry));
    }
    // Bounds memory for many extensions with many labels.
    if (entries.size() > Volume::kMostLabels) break;
    rest.remove_prefix(size);
  }
  return label_table(std::move(entries));
}

}  // namespace isomesh::import
