#include "server/import/source/source.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/source/line_reader.h"
#include "server/import/source/old_encodings.h"

namespace isomesh::import {
namespace {

// A file of another size belongs to another volume.
[[noreturn]] void throw_other_size(const std::string& name, std::uint64_t found,
                                   std::uint64_t expected) {
  throw_unusable("The data file " + in_quotes(name) + " has " + std::to_string(found) +
                 " bytes, but the header declares " + std::to_string(expected) + ".");
}

}  // namespace

std::optional<std::uint64_t> SourceVolume::packed_bytes(std::uint64_t decoded) const {
  if (encoding == Encoding::kRaw) return decoded;
  if (encoding == Encoding::kHalf) return decoded / 2;
  if (encoding == Encoding::kBits) return decoded / 8 + (decoded % 8 > 0 ? 1 : 0);
  return std::nullopt;
}

std::uint64_t SourceVolume::most_encoded_bytes() const {
  constexpr std::uint64_t kTextPerSample = 32;  // "-1.7976931348623157e+308" and white space
  constexpr std::uint64_t kHexPerByte = 4;
  switch (encoding) {
    case Encoding::kText:
    case Encoding::kFractionText:
      return sample_count() * chosen.count * kTextPerSample;
    case Encoding::kHex:
      return stored_bytes() * kHexPerByte;
    case Encoding::kHalf:
      return stored_bytes() / 2;
    case Encoding::kBits:
      return stored_bytes() / 8 + 1;
    case Encoding::kRaw:
    case Encoding::kDeflate:
    case Encoding::kBzip2:
    case Encoding::kVtk:
      break;
  }
  // Deflate stores incompressible data with a few extra bytes per block.
  constexpr std::uint64_t kStoredShare = 100;
  return stored_bytes() + stored_bytes() / kStoredShare;
}

CompressedRange range_from(const InputFile& file, std::uint64_t offset) {
  return {offset, file.size() - std::min(file.size(), offset)};
}

void check_limits(const SourceVolume& volume, const SizeLimits& limits) {
  check_limits(volume.sample_count(), canonical_type(volume.layout), limits);
}

void refuse_spacing(const ImportOptions& options) {
  if (!options.spacing) return;
  throw invalid_parameter("spacing",
                          "applies to files without a spacing, but this file has its own");
}

void refuse_flat(std::string_view what, const std::array<std::uint32_t, 3>& dims) {
  for (const std::size_t axis : {2, 1, 0}) {
    if (dims[axis] != 1) continue;
    throw_unusable(std::string(what) + " is a flat image: it has 1 slice of " +
                   std::to_string(dims[axis == 0 ? 1 : 0]) + " x " +
                   std::to_string(dims[axis == 2 ? 1 : 2]) +
                   " samples. A volume needs two slices or more, in one file, folder, ZIP or TAR.");
  }
}

Companions::Companions(const ArchiveFiles& archive, const std::filesystem::path& member)
    : archive_(&archive) {
  const std::filesystem::path normal = member.lexically_normal();
  name_ = normal.filename().string();
  folder_ = normal.parent_path();
}

const std::filesystem::path* Companions::find(const std::filesystem::path& path) const {
  if (archive_ == nullptr) return nullptr;
  const std::filesystem::path whole = folder_ / path;
  const std::string key = whole.lexically_normal().generic_string();
  if (key == (folder_ / name_).generic_string()) return nullptr;
  const auto found = archive_->find(key);
  return found == archive_->end() ? nullptr : &found->second;
}

ArchiveFiles Companions::all() const {
  ArchiveFiles companions;
  if (archive_ == nullptr) return companions;
  const std::string above = folder_.empty() ? "" : folder_.generic_string() + '/';
  for (auto at = archive_->lower_bound(above);
       at != archive_->end() && at->first.starts_with(above); ++at) {
    const std::string path = at->first.substr(above.size());
    if (path != name_) companions.emplace(path, at->second);
  }
  return companions;
}

std::set<std::string> Companions::below(const std::string& folder) const {
  std::set<std::string> names;
  const std::string path = (std::filesystem::path(folder) / "").lexically_normal().generic_string();
  if (archive_ == nullptr || path.size() < 2 || path.starts_with('/') || path.starts_with('.')) {
    return names;
  }
  const std::string above = folder_.empty() ? "" : folder_.generic_string() + '/';
  const std::string whole = above + path;
  for (auto at = archive_->lower_bound(whole);
       at != archive_->end() && at->first.starts_with(whole); ++at) {
    names.insert(at->first.substr(above.size()));
  }
  return names;
}

const std::filesystem::path& companion(const std::string& name, const Companions& companions) {
  const std::string reason = "The header names the data file " + in_quotes(name);
  const std::string path = std::filesystem::path(as_utf8(name, OldEncoding::kLatin1))
                               .lexically_normal()
                               .generic_string();
  if (path.starts_with('/') || path.starts_with("..") || name.find('\\') != std::string::npos) {
    throw_unusable(reason +
                   ", which is outside the header's folder. Only files in that folder and its "
                   "subfolders are read.");
  }
  if (const auto* found = companions.find(path)) return *found;
  throw_unusable(reason + ", which is missing. Send both files in one ZIP or TAR.");
}

std::optional<std::string> companion_with(std::initializer_list<std::string_view> suffixes,
                                          std::string_view name, const Companions& companions) {
  const std::string stem(name.substr(0, name.rfind('.')));
  for (const std::string_view suffix : suffixes) {
    std::string beside = stem + std::string(suffix);
    if (companions.find(beside) != nullptr) return beside;
  }
  return std::nullopt;
}

bool may_trail(std::uint64_t bytes, const SourceVolume& volume) {
  constexpr std::uint64_t kBlockBytes = 4096;
  const std::uint64_t slice = volume.volume_bytes() / volume.dims[2];
  return bytes <= kBlockBytes || bytes < volume.packed_bytes(slice).value_or(slice);
}

Note trailing_note(std::uint64_t bytes) {
  return note_of(NoteCode::kTrailingBytes,
                 "The data is " + std::to_string(bytes) + (bytes == 1 ? " byte" : " bytes") +
                     " longer than the header declares. The extra bytes were ignored.");
}

Note duplicate_note(std::size_t files) {
  return note_of(NoteCode::kDuplicateFile,
                 std::to_string(files) + (files == 1 ? " file is a copy" : " files are copies") +
                     " of another file, byte for byte. Each file was read once.");
}

std::string reason_of_double(std::string_view first_name) {
  return "it is the same as " + in_quotes(first_name);
}

std::uint64_t skip_lines(const InputFile& file, std::uint64_t offset, std::uint64_t count) {
  LineReader lines(file, {}, offset);
  while (count > 0) {
    const std::string_view piece = lines.view();
    if (piece.empty()) throw_unusable("The file ends within the lines that its header skips.");
    const std::size_t end = piece.find('\n');
    if (end != piece.npos) --count;
    lines.drop(end == piece.npos ? piece.size() : end + 1);
  }
  return lines.offset();
}

std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const DataSkip& skip,
                                    SourceVolume& volume) {
  if (names.empty()) throw_unusable("The header names no data file.");
  if (volume.sample_count() * volume.chosen.count % names.size() != 0) {
    throw_unusable("The header names " + std::to_string(names.size()) +
                   " data files. The samples cannot be divided equally among them.");
  }
  const bool is_raw = volume.encoding == Encoding::kRaw;
  const bool is_stream =
      volume.encoding == Encoding::kDeflate || volume.encoding == Encoding::kBzip2;
  if (is_stream && names.size() > 1 && skip.bytes != Skip(0)) {
    throw_unusable(
        "The header skips bytes in several compressed data files, which is not supported.");
  }
  if (is_stream) volume.decoded_skip = skip.bytes;
  const std::uint64_t decoded = volume.stored_bytes() / names.size();
  const std::optional<std::uint64_t> packed = volume.packed_bytes(decoded);
  const std::uint64_t part = packed.value_or(decoded);
  std::vector<DataFile> files;
  for (const std::string& name : names) {
    const std::filesystem::path& path = companion(name, companions);
    const InputFile file(path);
    const std::uint64_t size = file.size();
    const bool is_at_end = is_raw && !skip.bytes;
    const std::uint64_t begin =
        is_at_end ? size - std::min(size, part) : skip_lines(file, 0, skip.lines);
    const std::uint64_t bytes = is_stream || is_at_end ? 0 : skip.bytes.value_or(0);
    const std::uint64_t first = bytes > size - begin ? size + 1 : begin + bytes;
    if (first > size)
      throw_unusable("The data file " + in_quotes(name) + " ends before its samples begin.");
    files.push_back({path, {first, size - first}});
    if (!packed || size - first == part) continue;
    const std::uint64_t more = size - first - std::min(size - first, part);
    if (more == 0 || names.size() > 1 || !may_trail(more, volume)) {
      throw_other_size(name, size, first + part);
    }
    volume.notes.push_back(trailing_note(more));
  }
  return files;
}

Difference numbered(const std::string& what, const std::string& name) {
  return {.what = what,
          .title = [name](std::uint64_t index) { return name + ' ' + std::to_string(index); }};
}

std::uint64_t volumes_beyond(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 24;
  std::uint64_t count = 1;
  for (std::size_t axis = 3; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
    if (sizes[axis] > kMost / count) {
      throw_unusable("The size along " + axis_name(axis) +
                     " is not plausible: " + std::to_string(sizes[axis]) + ".");
    }
    count *= sizes[axis];
  }
  return count;
}

void choose_volume(std::uint64_t count, const Difference& difference, const ImportOptions& options,
                   SourceVolume& volume) {
  const auto chosen = options.volume;
  volume.chosen.count = count;
  volume.chosen.index = chosen.value_or(0);
  if (count == 1 && volume.chosen.index == 0) return;
  if (chosen && *chosen < count) {
    volume.notes.push_back(note_of(
        NoteCode::kVolumeChosen, "Volume " + std::to_string(*chosen) + " (" +
                                     difference.title(*chosen) + ") of " + std::to_string(count) +
                                     " was read. The volumes differ in " + difference.what + "."));
    return;
  }
  if (count == 1) {
    throw_unusable("The file has only volume 0. It has no volume " + std::to_string(*chosen) + ".");
  }
  constexpr std::uint64_t kMost = 1000;
  std::vector<Choice> choices;
  for (std::uint64_t index = 0; index < std::min(count, kMost); ++index) {
    choices.push_back({"volume", std::to_string(index), difference.title(index)});
  }
  const std::string reason = "The file holds " + std::to_string(count) +
                             " volumes that differ in " + difference.what + ". ";
  const std::string none = chosen ? "It has no volume " + std::to_string(*chosen) + ". " : "";
  throw_choice(
      reason + none + "Choose one with volume=0 to volume=" + std::to_string(count - 1) + ".",
      std::move(choices));
}

void accept_frames(std::uint64_t frames, const std::string& axis, const ImportOptions& options,
                   SourceVolume& volume) {
  const std::string sequence = "The file is a sequence of " + std::to_string(frames) +
                               " flat images of " + std::to_string(volume.dims[0]) + " x " +
                               std::to_string(volume.dims[1]) + " samples along " + axis + ". ";
  if (!options.accepts(NoteCode::kFramesAsSlices)) {
    throw_overridable(NoteCode::kFramesAsSlices,
                      sequence +
                          "It does not say that they lie side by side as the slices of a volume "
                          "do. If accepted, they are read as evenly spaced slices.");
  }
  volume.notes.push_back(note_of(NoteCode::kFramesAsSlices,
                                 sequence +
                                     "They were read as the slices of a volume. The distance "
                                     "between them is not from a scan."));
}

std::uint64_t volumes_of_frames(std::uint64_t count, const std::string& axis,
                                const ImportOptions& options, SourceVolume& volume) {
  const auto& [x, y, z] = volume.dims;
  if (count < 2 || z != 1 || x == 1 || y == 1 || options.volume) return count;
  accept_frames(count, axis, options, volume);
  volume.dims[2] = static_cast<std::uint32_t>(count);
  return 1;
}

std::string begin_remedy(const ImportOptions& options, const std::string& verb) {
  if (!options.peers) return ' ' + verb + ' ';
  return " An order has no parameter for this. Download the series, and upload it with ";
}

}  // namespace isomesh::import
