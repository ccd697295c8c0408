#include "server/import/archives/import.h"

#include <algorithm>
#include <cerrno>
#include <string>
#include <vector>

#include <stdlib.h>

#include "base/error.h"
#include "base/text.h"
#include "proto/error.h"
#include "server/import/archives/archive.h"
#include "server/import/dicom/import.h"
#include "server/import/readers.h"

namespace isomesh::import {
namespace {

// A folder within the scratch folder, removed with all that was unpacked into it.
class MembersFolder {
 public:
  explicit MembersFolder(const std::filesystem::path& scratch)
      : path_((scratch / "members-XXXXXX").string()) {
    if (::mkdtemp(path_.data()) == nullptr) throw_system_error("mkdtemp", errno);
  }
  ~MembersFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  MembersFolder(const MembersFolder&) = delete;
  MembersFolder& operator=(const MembersFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

// A member that is of a format that is read.
struct FoundVolume {
  ArchiveMember member;
  const Reader* reader = nullptr;
};

ArchiveLimits limits_of(const SizeLimits& limits) {
  return {.max_bytes = limits.max_sample_bytes + kHeadroomBytes};
}

std::vector<FoundVolume> volumes_among(const std::vector<ArchiveMember>& members) {
  std::vector<FoundVolume> volumes;
  for (const ArchiveMember& member : members) {
    const Reader* reader = sniff(InputFile(member.path));
    if (reader == nullptr) continue;
    if (reader->content == Content::kFiles) {
      throw_unusable("The archive holds another archive, " + in_quotes(member.name) +
                     "; send that one by itself.");
    }
    volumes.push_back({member, reader});
  }
  return volumes;
}

const FoundVolume* first_slice(const std::vector<FoundVolume>& volumes) {
  const auto found = std::ranges::find_if(volumes, [](const FoundVolume& volume) {
    return volume.reader->content == Content::kSlices;
  });
  return found == volumes.end() ? nullptr : &*found;
}

// A list for a person, who is told how many follow the first few.
std::string names_of(const std::vector<FoundVolume>& volumes) {
  constexpr std::size_t kMost = 10;
  std::string names;
  for (std::size_t at = 0; at < std::min(kMost, volumes.size()); ++at) {
    names += (at > 0 ? ", " : "") + in_quotes(volumes[at].member.name);
  }
  if (volumes.size() > kMost) names += " and " + std::to_string(volumes.size() - kMost) + " more";
  return names;
}

Companions companions_of(const ArchiveMember& header, const std::vector<ArchiveMember>& members) {
  Companions companions;
  for (const ArchiveMember& member : members) {
    if (member.name == header.name || folder_of(member.name) != folder_of(header.name)) continue;
    companions.emplace(base_of(member.name), member.path);
  }
  return companions;
}

// All members are read, because the answer names those that are no part of the series: files of
// other kinds, and volumes that somebody has made of the same slices.
Volume read_slices(const Reader& reader, const std::vector<ArchiveMember>& members,
                   const Input& input) {
  if (input.listener) input.listener(reader.name);
  std::vector<std::filesystem::path> files;
  files.reserve(members.size());
  for (const ArchiveMember& member : members) files.push_back(member.path);
  return import_dicom(files, input.task);
}

Volume read_members(const std::vector<ArchiveMember>& members, const Input& input) {
  const std::vector<FoundVolume> volumes = volumes_among(members);
  if (volumes.empty()) {
    throw Error(ErrorCode::kUnsupportedMedia, "None of the archive's " +
                                                  std::to_string(members.size()) +
                                                  " files is a volume of a format that is read.");
  }
  if (const FoundVolume* slice = first_slice(volumes)) {
    return read_slices(*slice->reader, members, input);
  }
  if (volumes.size() > 1) {
    throw_unusable("The archive holds " + std::to_string(volumes.size()) +
                   " volumes, where one is needed: " + names_of(volumes) + ".");
  }
  const auto& [member, reader] = volumes.front();
  Volume volume = read_input(*reader, {.path = member.path,
                                       .companions = companions_of(member, members),
                                       .task = input.task,
                                       .listener = input.listener});
  volume.name = std::string(base_of(member.name));
  return volume;
}

}  // namespace

bool is_archive(std::string_view head) { return is_zip(head) || is_tar(head); }

Volume parse_archive(const Input& input) {
  const MembersFolder folder(input.task.scratch);
  return read_members(unpack(input.path, folder.path(), limits_of(input.task.limits)), input);
}

std::uint64_t most_archive_bytes(const InputFile& file, const SizeLimits& limits) {
  return std::min(limits_of(limits).max_bytes + kHeadroomBytes, most_unpacked_bytes(file.size()));
}

}  // namespace isomesh::import
