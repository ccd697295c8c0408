#include "server/import/source.h"

#include <algorithm>
#include <limits>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh::import {
namespace {

const std::filesystem::path& companion(const std::string& name, const Companions& companions) {
  const std::string reason = "Its samples are in another file, " + in_quotes(name) + ", ";
  if (name.find_first_of("/\\") != std::string::npos) {
    throw_unusable(reason + "which is named by a path; only files beside it can be followed.");
  }
  const auto found = companions.find(name);
  if (found != companions.end()) return found->second;
  throw_unusable(reason + "which did not come with it; send both in one ZIP or TAR.");
}

// A file of another size than the header tells belongs to another volume.
void check_raw_part(const std::string& name, std::uint64_t found, std::uint64_t skipped,
                    std::uint64_t expected) {
  if (found == skipped + expected) return;
  throw_unusable("The data file " + in_quotes(name) + " has " + std::to_string(found) +
                 " bytes, where the header tells " + std::to_string(skipped + expected) + ".");
}

}  // namespace

std::uint64_t SourceVolume::most_encoded_bytes() const {
  constexpr std::uint64_t kTextPerSample = 32;  // "-1.7976931348623157e+308", and white space
  constexpr std::uint64_t kHexPerByte = 4;
  switch (encoding) {
    case Encoding::kText:
      return sample_count() * kTextPerSample;
    case Encoding::kHex:
      return stored_bytes() * kHexPerByte;
    case Encoding::kRaw:
    case Encoding::kDeflate:
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

std::vector<DataFile> data_files_of(const std::vector<std::string>& names,
                                    const Companions& companions, const SourceVolume& volume,
                                    const Skip& skip) {
  if (names.empty()) throw_unusable("The header names no data file.");
  if (volume.sample_count() % names.size() != 0) {
    throw_unusable("The header names " + std::to_string(names.size()) + " data files, which " +
                   std::to_string(volume.sample_count()) + " samples cannot be shared out to.");
  }
  if (!skip && volume.encoding != Encoding::kRaw) {
    throw_unusable("The header says that encoded samples end with their file.");
  }
  const std::uint64_t part = volume.stored_bytes() / names.size();
  std::vector<DataFile> files;
  for (const std::string& name : names) {
    const std::filesystem::path& path = companion(name, companions);
    const std::uint64_t size = InputFile(path).size();
    const std::uint64_t first = skip ? *skip : size - std::min(size, part);
    if (first > size)
      throw_unusable("The data file " + in_quotes(name) + " ends before its samples begin.");
    if (volume.encoding == Encoding::kRaw) check_raw_part(name, size, first, part);
    files.push_back({path, {first, size - first}});
  }
  return files;
}

}  // namespace isomesh::import
