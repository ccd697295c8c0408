#include "server/import/labels/label_table.h"

#include <algorithm>
#include <cmath>

#include "base/hex.h"
#include "base/text.h"
#include "proto/json_tree.h"
#include "server/import/source/names.h"
#include "server/volume/names.h"

namespace isomesh::import {
namespace {

// Names, and about ten bytes per value: bounded by the size of an import's response.
constexpr std::size_t kMostTableBytes = std::size_t{4} << 20;

void check_size(const std::vector<LabelEntry>& entries) {
  if (entries.size() > Volume::kMostLabels) {
    throw_unusable("The file has " + std::to_string(entries.size()) + " labels. At most " +
                   std::to_string(Volume::kMostLabels) + " are supported.");
  }
  constexpr std::size_t kBytesOfValue = 8;
  std::size_t bytes = 0;
  for (const LabelEntry& entry : entries) {
    bytes += entry.name.size() + entry.values.size() * kBytesOfValue;
  }
  if (bytes <= kMostTableBytes) return;
  throw_unusable("The names and overlaps of the file's labels take more than the " +
                 std::to_string(kMostTableBytes) + " bytes that can be stored.");
}

}  // namespace

std::string label_name(std::string_view text) {
  // Cut before conversion, which may lengthen the text.
  const std::string_view first = beginning(trimmed(text), LabelEntry::kMostNameBytes);
  const std::string name = volume::normalized(printable(valid_utf8(first)));
  return std::string(beginning(name, LabelEntry::kMostNameBytes));
}

std::optional<std::string> label_color(const std::array<double, 3>& parts) {
  std::array<std::uint8_t, 3> bytes = {};
  for (std::size_t at = 0; at < parts.size(); ++at) {
    if (!std::isfinite(parts[at])) return std::nullopt;
    bytes[at] = static_cast<std::uint8_t>(std::lround(std::clamp(parts[at], 0.0, 1.0) * 255));
  }
  return '#' + to_hex(bytes);
}

std::vector<LabelEntry> label_table(std::vector<LabelEntry> entries) {
  std::ranges::stable_sort(entries, {}, &LabelEntry::label);
  const auto is_same = [](const LabelEntry& a, const LabelEntry& b) { return a.label == b.label; };
  entries.erase(std::unique(entries.begin(), entries.end(), is_same), entries.end());
  check_size(entries);
  return entries;
}

}  // namespace isomesh::import
