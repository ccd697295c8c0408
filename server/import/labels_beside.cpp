#include "server/import/labels_beside.h"

#include <algorithm>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "server/import/labels/label_table.h"
#include "server/import/labels/label_text.h"
#include "server/import/readers.h"
#include "server/import/source/reader.h"

namespace isomesh::import {
namespace {

struct Table {
  std::string name;
  std::vector<LabelEntry> labels;
};

std::string lower_name(const std::string& name) {
  return lower(std::filesystem::path(name).filename().string());
}

// "head" of "head.nii.gz".
std::string stem_of(const std::string& name) {
  std::filesystem::path base = lower_name(name);
  if (base.extension() == ".gz") base = base.stem();
  return base.stem().string();
}

// True if a file's name is the stem plus a separate suffix, like "head_labels.txt" for "head".
bool begins_with(const std::string& name, const std::string& stem) {
  const auto is_word = [](char letter) {
    return (letter >= 'a' && letter <= 'z') || (letter >= '0' && letter <= '9');
  };
  const std::string base = lower_name(name);
  return !stem.empty() && base.starts_with(stem) &&
         (base.size() == stem.size() || !is_word(base[stem.size()]));
}

bool is_text(std::string_view bytes) {
  return std::ranges::none_of(bytes, [](char letter) {
    return static_cast<unsigned char>(letter) < ' ' && letter != '\t' && letter != '\r' &&
           letter != '\n';
  });
}

// The labels of a table file; none of any other file.
std::vector<LabelEntry> labels_of(const std::filesystem::path& path) {
  const InputFile file(path);
  // Larger members of an archive may be truncated.
  if (file.size() >= kBeginningBytes || !is_text(file.text(0, kSniffBytes))) return {};
  try {
    return label_table(labels_of_text(file.text(0, kBeginningBytes)));
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kUnusableVolume) throw;
    return {};  // labels are optional; the samples are usable without them
  }
}

template <class IsWanted>
std::vector<Table> tables_in(const Companions& companions, const IsWanted& is_wanted) {
  std::vector<Table> tables;
  for (const auto& [name, path] : companions.all()) {
    auto labels = labels_of(path);
    if (!labels.empty() && is_wanted(name)) tables.push_back({name, std::move(labels)});
  }
  return tables;
}

std::vector<std::string> stems_of_volumes(const Companions& companions) {
  std::vector<std::string> stems;
  for (const auto& [name, path] : companions.all()) {
    if (sniff(InputFile(path)) != nullptr) stems.push_back(stem_of(name));
  }
  return stems;
}

// The tables with only suffixes after the stem, like "head.txt" and "head.nii.txt".
std::vector<Table> named_as(const std::string& stem, std::vector<Table> tables) {
  std::erase_if(tables, [&](const Table& table) {
    return stem_of(table.name) != stem && stem_of(stem_of(table.name)) != stem;
  });
  return tables;
}

std::vector<Table> tables_beside(const Companions& companions) {
  const std::string stem = stem_of(companions.name());
  const auto is_own = [&](const std::string& name) { return begins_with(name, stem); };
  std::vector<Table> tables = tables_in(companions, is_own);
  if (tables.empty()) {
    const std::vector<std::string> others = stems_of_volumes(companions);
    tables = tables_in(companions, [&](const std::string& name) {
      return std::ranges::none_of(
          others, [&](const std::string& other) { return begins_with(name, other); });
    });
  } else if (tables.size() > 1) {
    std::vector<Table> exact = named_as(stem, tables);
    if (!exact.empty()) return exact;
  }
  return tables;
}

}  // namespace

bool is_label_table(const std::filesystem::path& path) { return !labels_of(path).empty(); }

void take_labels_beside(const Companions& companions, Volume& volume) {
  if (!is_integer(volume.type)) return;
  const auto note =
      std::ranges::find(volume.notes, describe(NoteCode::kLooksLikeLabels).name, &Note::code);
  if (!volume.labels.empty() || note == volume.notes.end()) return;
  std::vector<Table> tables = tables_beside(companions);
  if (tables.empty()) return;
  if (tables.size() > 1) {
    note->detail +=
        " Several tables of label names fit, so none was used: " + in_quotes(tables[0].name) +
        " and " + in_quotes(tables[1].name) + (tables.size() > 2 ? ", among others." : ".");
    return;
  }
  volume.labels = std::move(tables.front().labels);
  note->detail += " The names of the labels are from " + in_quotes(tables.front().name) + '.';
}

}  // namespace isomesh::import
