#include "server/volume/source.h"

#include <algorithm>
#include <limits>

#include "proto/error.h"
#include "server/volume/text.h"

namespace isomesh::volume {
namespace {

void check_beyond(std::span<const std::uint64_t> sizes) {
  for (std::size_t axis = 3; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 1) continue;
    const std::string size = std::to_string(sizes[axis]);
    throw_unusable(axis == 3 ? "The file holds a time series of " + size +
                                   " volumes, where one volume is needed."
                             : "The file has " + size + " values along its axis " +
                                   axis_name(axis) + ", where one volume is needed.");
  }
}

const std::filesystem::path& companion(const std::string& name, const Companions& companions) {
  const std::string reason = "Its samples are in another file, " + in_quotes(name) + ", ";
  if (name.find_first_of("/\\") != std::string::npos) {
    throw_unusable(reason + "which is named by a path; only files beside it can be followed.");
  }
  const auto found = companions.find(name);
  if (found != companions.end()) return found->second;
  throw_unusable(reason + "which did not come with it; send both in one ZIP or TAR.");
}

// More or fewer bytes than the header tells are another volume than it describes.
void check_raw_part(const std::string& name, std::uint64_t found, std::uint64_t skipped,
                    std::uint64_t expected) {
  if (found == skipped + expected) return;
  throw_unusable("The data file " + in_quotes(name) + " has " + std::to_string(found) +
                 " bytes, where the header tells " + std::to_string(skipped + expected) + ".");
}

}  // namespace

void throw_unusable(const std::string& reason) { throw Error(ErrorCode::kUnusableVolume, reason); }

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

std::array<std::uint32_t, 3> volume_dims(std::span<const std::uint64_t> sizes) {
  constexpr std::uint64_t kMostSamples = std::uint64_t{1} << 60;
  std::array<std::uint32_t, 3> dims = {1, 1, 1};
  std::uint64_t samples = 1;
  for (std::size_t axis = 0; axis < sizes.size(); ++axis) {
    if (sizes[axis] == 0) throw_unusable("The size along " + axis_name(axis) + " is 0.");
  }
  check_beyond(sizes);
  for (std::size_t axis = 0; axis < sizes.size() && axis < dims.size(); ++axis) {
    if (sizes[axis] > std::numeric_limits<std::uint32_t>::max() ||
        samples > kMostSamples / sizes[axis]) {
      throw_unusable("The header's sizes are not believable: " + std::to_string(sizes[axis]) +
                     " along " + axis_name(axis) + ".");
    }
    samples *= sizes[axis];
    dims[axis] = static_cast<std::uint32_t>(sizes[axis]);
  }
  return dims;
}

}  // namespace isomesh::volume
