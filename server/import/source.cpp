#include "server/import/source.h"

#include <algorithm>
#include <limits>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::import {
namespace {

// A file of another size than the header tells belongs to another volume.
[[noreturn]] void throw_other_size(const std::string& name, std::uint64_t found,
                                   std::uint64_t expected) {
  throw_unusable("The data file " + in_quotes(name) + " has " + std::to_string(found) +
                 " bytes, where the header tells " + std::to_string(expected) + ".");
}

}  // namespace

std::uint64_t SourceVolume::most_encoded_bytes() const {
  constexpr std::uint64_t kTextPerSample = 32;  // "-1.7976931348623157e+308", and white space
  constexpr std::uint64_t kHexPerByte = 4;
  switch (encoding) {
    case Encoding::kText:
      return sample_count() * chosen.count * kTextPerSample;
    case Encoding::kHex:
      return stored_bytes() * kHexPerByte;
    case Encoding::kRaw:
    case Encoding::kDeflate:
    case Encoding::kBzip2:
    case Encoding::kVtk:
      break;
  }
  // Whatever deflate cannot compress it stores, with a few bytes for each block.
  constexpr std::uint64_t kStoredShare = 100;
  return stored_bytes() + stored_bytes() / kStoredShare;
}

void check_limits(const SourceVolume& volume, const SizeLimits& limits) {
  check_limits(volume.sample_count(), canonical_type(volume.layout), limits);
}

const std::filesystem::path& companion(const std::string& name, const Companions& companions) {
  const std::string reason = "Its samples are in another file, " + in_quotes(name) + ", ";
  const std::string path = std::filesystem::path(name).lexically_normal().generic_string();
  if (path.starts_with('/') || path.starts_with("..") || name.find('\\') != std::string::npos) {
    throw_unusable(reason +
                   "which lies outside of its folder; only files beside it or in folders "
                   "there can be followed.");
  }
  const auto found = companions.files.find(path);
  if (found != companions.files.end()) return found->second;
  throw_unusable(reason + "which did not come with it; send both in one ZIP or TAR.");
}

bool may_trail(std::uint64_t bytes, const SourceVolume& volume) {
  constexpr std::uint64_t kBlockBytes = 4096;
  return bytes <= kBlockBytes || bytes < volume.volume_bytes() / volume.dims[2];
}

Note trailing_note(std::uint64_t bytes) {
  return note_of(NoteCode::kTrailingBytes, "The data has " + std::to_string(bytes) +
                                               " bytes more than the header tells; they were left "
                                               "out.");
}

Note duplicate_note(std::size_t files) {
  return note_of(NoteCode::kDuplicateFile,
                 std::to_string(files) + (files == 1 ? " file" : " files") +
                     " came more than once, byte for byte, and each was taken once.");
}

std::string reason_of_double(std::string_view first_name) {
  return "it is the same as " + in_quotes(first_name);
}

std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const Skip& skip,
                                    SourceVolume& volume) {
  if (names.empty()) throw_unusable("The header names no data file.");
  if (volume.sample_count() * volume.chosen.count % names.size() != 0) {
    throw_unusable("The header names " + std::to_string(names.size()) + " data files, which " +
                   std::to_string(volume.sample_count()) + " samples cannot be shared out to.");
  }
  const bool is_raw = volume.encoding == Encoding::kRaw;
  if (!is_raw && names.size() > 1 && skip != Skip(0)) {
    throw_unusable("Skipping bytes within several encoded files is not supported.");
  }
  if (!is_raw) volume.decoded_skip = skip;
  const std::uint64_t part = volume.stored_bytes() / names.size();
  std::vector<DataFile> files;
  for (const std::string& name : names) {
    const std::filesystem::path& path = companion(name, companions);
    const std::uint64_t size = InputFile(path).size();
    const std::uint64_t first = !is_raw ? 0 : skip ? *skip : size - std::min(size, part);
    if (first > size)
      throw_unusable("The data file " + in_quotes(name) + " ends before its samples begin.");
    files.push_back({path, {first, size - first}});
    if (!is_raw || size - first == part) continue;
    const std::uint64_t more = size - first - std::min(size - first, part);
    if (more == 0 || names.size() > 1 || !may_trail(more, volume)) {
      throw_other_size(name, size, first + part);
    }
    volume.notes.push_back(trailing_note(more));
  }
  return files;
}

std::uint64_t volumes_beyond(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMost = std::uint64_t{1} << 24;
  std::uint64_t count = 1;
  for (std::size_t axis = 3; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
    if (sizes[axis] > kMost / count) {
      throw_unusable("The header's sizes are not believable: " + std::to_string(sizes[axis]) +
                     " along " + axis_name(axis) + ".");
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
    volume.notes.push_back(note_of(NoteCode::kVolumeChosen,
                                   "Volume " + std::to_string(*chosen) + " (" +
                                       difference.title(*chosen) + ") of " + std::to_string(count) +
                                       ", which differ in " + difference.what + ", was taken."));
    return;
  }
  if (count == 1) {
    throw_unusable("The file holds one volume, 0, and no volume " + std::to_string(*chosen) + ".");
  }
  constexpr std::uint64_t kMost = 1000;
  std::vector<Choice> choices;
  for (std::uint64_t index = 0; index < std::min(count, kMost); ++index) {
    choices.push_back({"volume", std::to_string(index), difference.title(index)});
  }
  const std::string there = std::to_string(count) + " volumes";
  const std::string range = "volume=0 to " + std::to_string(count - 1);
  throw_choice(chosen ? "The file holds " + there + " and has no volume " +
                            std::to_string(*chosen) + "; choose one with " + range + "."
                      : "The file holds " + there + " that differ in " + difference.what +
                            ", where one volume is needed; choose one with " + range + ".",
               std::move(choices));
}

}  // namespace isomesh::import
