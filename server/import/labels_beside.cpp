#include "server/import/labels_beside.h"

#include <algorithm>
#include <filesystem>
#include <span>
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
#include "server/import/samples/transfer.h"
#include "server/import/source/reader.h"
#include "server/volume/canonical.h"
#include "server/volume/labels.h"

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

auto labels_note_of(Volume& volume) {
  return std::ranges::find(volume.notes, describe(NoteCode::kLooksLikeLabels).name, &Note::code);
}

bool names(const Table& table, std::int64_t value) {
  const auto found = std::ranges::lower_bound(table.labels, value, {}, &LabelEntry::label);
  return found != table.labels.end() && found->label == value;
}

// How many of the values a table names. 0 is the background, which needs no name.
struct Naming {
  std::size_t named = 0;
  std::size_t values = 0;  // without 0

  bool is_any() const { return named > 0; }
  bool is_most() const { return is_any() && named * 2 >= values; }
  std::string text() const {
    return std::to_string(named) + " of the " + std::to_string(values) +
           (values == 1 ? " value" : " different values") + " other than 0";
  }
};

Naming naming_of(const Table& table, const std::vector<std::int64_t>& values) {
  Naming naming;
  for (const std::int64_t value : values) {
    if (value == 0) continue;
    ++naming.values;
    if (names(table, value)) ++naming.named;
  }
  return naming;
}

// A table lies beside images, too, and large ones name each value of a byte. So the samples must be
// few different values. Otherwise the table must have the volume's name, and the samples must lie
// in small regions, which hardly any neighbours of an image do, but for its background.
bool could_be_labels(std::span<const std::byte> samples, const Volume& volume, std::size_t values,
                     bool is_own) {
  constexpr std::size_t kFew = 64;
  constexpr double kSmallRegions = 0.3;
  if (values <= kFew) return true;
  return is_own &&
         volume::share_of_equal_neighbours(samples, volume.type, volume.dims) >= kSmallRegions;
}

// Replaces the volume's canonical file, which stays mapped as `samples`, by one of integers.
void convert(std::span<const std::byte> samples, SampleType type, const ImportTask& task,
             Volume& volume) {
  const SampleType stored = std::exchange(volume.type, type);
  std::filesystem::remove(task.target);
  CanonicalWriter writer(task.target, {volume.dims, type, volume.geometry});
  volume::store_whole(samples, stored, type, writer.samples().data());
  // Samples that are no numbers have a value by now, which the first suggestion left out.
  const std::string_view left_out = describe(NoteCode::kNonFiniteSamples).name;
  const bool keeps_iso =
      std::ranges::find(volume.notes, left_out, &Note::code) != volume.notes.end();
  const double iso = volume.suggested_iso;
  volume = finish(writer, std::move(volume));
  if (keeps_iso) volume.suggested_iso = iso;
}

// Makes labels of the volume in the task's target if its samples could be those that the table
// names: whole numbers, none negative, most of them named. Adds a note then. Returns false if not.
bool become_labels(const Table& table, bool is_own, const ImportTask& task, Volume& volume) {
  const volume::CanonicalVolume canonical(task.target);
  const std::span<const std::byte> samples = canonical.samples();
  const auto numbers = volume::whole_numbers(samples, volume.type);
  if (!numbers || numbers->low < 0) return false;
  const auto values = volume::distinct_values(samples, volume.type, Volume::kMostLabels + 1);
  if (!values) return false;
  const Naming naming = naming_of(table, *values);
  if (!naming.is_most() || !could_be_labels(samples, volume, values->size(), is_own)) return false;
  std::string detail = "A table of names is beside the file, and it names " + naming.text() +
                       ". So the samples were read as labels.";
  if (!is_integer(volume.type)) {
    const std::string stored(to_string(volume.type));
    if (!numbers->is_exact) volume.notes.push_back(volume::rounded_note(volume.type));
    convert(samples, numbers->type, task, volume);
    detail += " The whole numbers, " + stored + " in the file, are now " +
              std::string(to_string(volume.type)) + '.';
  }
  std::erase_if(volume.notes, [](const Note& note) {
    return note.code == describe(NoteCode::kLooksLikeLabels).name;
  });
  volume.notes.push_back(note_of(NoteCode::kLooksLikeLabels, detail));
  return true;
}

// The labels of a volume that has some, or looks like them.
Naming naming_in(const Table& table, const ImportTask& task, const Volume& volume) {
  if (!volume.labels.empty()) {
    std::vector<std::int64_t> labels;
    for (const LabelEntry& entry : volume.labels) labels.push_back(entry.label);
    return naming_of(table, labels);
  }
  const volume::CanonicalVolume canonical(task.target);
  const auto values =
      volume::distinct_values(canonical.samples(), volume.type, Volume::kMostLabels + 1);
  return values ? naming_of(table, *values) : Naming{};
}

// Labels that the volume has keep their values and their own colours.
void take_names(std::vector<LabelEntry> named, std::vector<LabelEntry>& labels) {
  if (labels.empty()) {
    labels = std::move(named);
    return;
  }
  for (LabelEntry& entry : labels) {
    const auto found = std::ranges::lower_bound(named, entry.label, {}, &LabelEntry::label);
    if (found == named.end() || found->label != entry.label) continue;
    entry.name = found->name;
    if (!entry.color) entry.color = found->color;
  }
}

}  // namespace

bool is_label_table(const std::filesystem::path& path) { return !labels_of(path).empty(); }

void take_labels_beside(const Companions& companions, const ImportTask& task, Volume& volume) {
  const auto has_name = [](const LabelEntry& entry) { return !entry.name.empty(); };
  if (std::ranges::any_of(volume.labels, has_name)) return;
  std::vector<Table> tables = tables_beside(companions);
  if (tables.empty()) return;
  if (tables.size() > 1) {
    const auto note = labels_note_of(volume);
    if (note == volume.notes.end()) return;
    note->detail +=
        " Several tables of label names fit, so none was used: " + in_quotes(tables[0].name) +
        " and " + in_quotes(tables[1].name) + (tables.size() > 2 ? ", among others." : ".");
    return;
  }
  Table& table = tables.front();
  const bool looks_like_labels = labels_note_of(volume) != volume.notes.end();
  if (!looks_like_labels || !is_integer(volume.type)) {
    const bool is_own = begins_with(table.name, stem_of(companions.name()));
    if (!become_labels(table, is_own, task, volume)) {
      if (looks_like_labels) {
        labels_note_of(volume)->detail += " The table " + in_quotes(table.name) +
                                          " does not name most of them, so it was not used.";
      }
      return;
    }
  } else if (!naming_in(table, task, volume).is_any()) {
    labels_note_of(volume)->detail +=
        " The table " + in_quotes(table.name) + " names none of the labels, so it was not used.";
    return;
  }
  labels_note_of(volume)->detail +=
      " The names of the labels are from " + in_quotes(table.name) + '.';
  take_names(std::move(table.labels), volume.labels);
}

}  // namespace isomesh::import
