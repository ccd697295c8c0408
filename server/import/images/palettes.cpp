#include "server/import/images/palettes.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <string>
#include <string_view>

#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

// The limit for the indices of all palettes, each of which has a colour and a flag.
constexpr std::uint64_t kMostIndices = std::uint64_t{1} << 23;

std::size_t indices_of(StoredType type) {
  return type == StoredType::kUint8 ? std::size_t{1} << 8 : std::size_t{1} << 16;
}

bool is_grey(const Colour& colour) { return colour[0] == colour[1] && colour[0] == colour[2]; }

std::string text_of(const std::optional<Colour>& colour) {
  constexpr std::string_view kDigits = "0123456789abcdef";
  if (!colour) return "beyond the palette";
  std::string text = "#";
  for (const std::uint8_t part : *colour) {
    text += kDigits[part / 16];
    text += kDigits[part % 16];
  }
  return text;
}

// Calls `use` with each sample, which it may change.
template <class Bytes, class Use>
void for_each_index(Bytes samples, StoredType type, Use use) {
  const auto visit = [&](auto index) {
    for (std::size_t at = 0; at + sizeof(index) <= samples.size(); at += sizeof(index)) {
      std::memcpy(&index, samples.data() + at, sizeof(index));
      use(index, samples.data() + at);
    }
  };
  if (type == StoredType::kUint8) {
    visit(std::uint8_t{});
  } else {
    visit(std::uint16_t{});
  }
}

}  // namespace

void Palettes::begin(const PageLayout& layout) {
  const std::uint64_t page = pages_++;
  if (!runs_.empty() && runs_.back().palette == layout.palette) return;
  const std::size_t count = layout.palette.empty() ? 0 : indices_of(layout.type);
  indices_ += count;
  if (indices_ > kMostIndices) {
    throw_unusable("The pages have too many different palettes. Save them with one palette.");
  }
  runs_.push_back({.first_page = page,
                   .palette = layout.palette,
                   .used = std::vector<bool>(count),
                   .type = layout.type});
}

void Palettes::use(std::span<const std::byte> samples) {
  Run& run = runs_.back();
  if (run.palette.empty()) return;
  for_each_index(samples, run.type, [&](auto index, const std::byte* /*place*/) {
    run.used[index] = true;
    beyond_ += index < run.palette.size() ? 0 : 1;
  });
}

bool Palettes::are_grey() const {
  return std::ranges::all_of(
      runs_, [](const Run& run) { return std::ranges::all_of(run.palette, is_grey); });
}

bool Palettes::replaces() const {
  return are_grey() && std::ranges::any_of(runs_, [](const Run& run) {
           for (std::size_t index = 0; index < run.used.size(); ++index) {
             if (run.used[index] && run.grey(index) != index) return true;
           }
           return false;
         });
}

void Palettes::replace(std::uint64_t page, std::span<std::byte> samples) const {
  const auto behind = std::ranges::upper_bound(runs_, page, {}, &Run::first_page);
  const Run& run = *(behind - 1);
  if (run.palette.empty()) return;
  for_each_index(samples, run.type, [&](auto index, std::byte* place) {
    index = run.grey(index);
    std::memcpy(place, &index, sizeof(index));
  });
}

std::vector<LabelEntry> Palettes::labels() const {
  if (are_grey()) return {};
  std::map<std::size_t, std::optional<Colour>> colours;
  for (const Run& run : runs_) {
    if (run.palette.empty()) {
      throw_unusable(
          "Some pages are indexed pictures with a palette of colours, and others are grey. Save "
          "all of them in one way.");
    }
    for (std::size_t index = 0; index < run.used.size(); ++index) {
      if (!run.used[index]) continue;
      const std::optional<Colour> colour = run.colour(index);
      const auto [found, is_new] = colours.try_emplace(index, colour);
      if (is_new || found->second == colour) continue;
      throw_unusable("The pages have different palettes: index " + std::to_string(index) + " is " +
                     text_of(found->second) + " in one page, and " + text_of(colour) +
                     " in another, so it is not clear which label it is. Save all pages with one "
                     "palette, or as grey pictures of the labels' numbers.");
    }
  }
  std::vector<LabelEntry> labels;
  for (const auto& [index, colour] : colours) {
    if (index == 0) continue;
    LabelEntry& entry = labels.emplace_back();
    entry.label = static_cast<std::int64_t>(index);
    if (colour) entry.color = text_of(colour);
  }
  return labels;
}

std::optional<Note> Palettes::note() const {
  if (beyond_ == 0) return std::nullopt;
  return note_of(
      NoteCode::kHeaderCorrected,
      std::to_string(beyond_) + (beyond_ == 1 ? " sample has an index" : " samples have an index") +
          " beyond the colours of the picture's palette. " +
          (are_grey() ? "They were read as 0, which is black. Some programs show other greys."
                      : "Such an index is a label without a colour."));
}

}  // namespace isomesh::import
