#include "server/import/archives/import.h"

#include <algorithm>
#include <cerrno>
#include <set>
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

Companions companions_of(const ArchiveMember& header, const std::vector<ArchiveMember>& members) {
  const std::string_view folder = folder_of(header.name);
  Companions companions{.name = std::string(base_of(header.name)), .files = {}};
  for (const ArchiveMember& member : members) {
    if (member.name == header.name || !member.name.starts_with(folder)) continue;
    const std::filesystem::path below = member.name.substr(folder.size());
    companions.files.emplace(below.lexically_normal().generic_string(), member.path);
  }
  return companions;
}

std::vector<FoundVolume> files_of_formats(const std::vector<ArchiveMember>& members) {
  std::vector<FoundVolume> found;
  for (const ArchiveMember& member : members) {
    const Reader* reader = sniff(InputFile(member.path));
    if (reader == nullptr) continue;
    if (reader->content == Content::kFiles) {
      throw_unusable("The archive holds another archive, " + in_quotes(member.name) +
                     "; send that one by itself.");
    }
    found.push_back({member, reader});
  }
  return found;
}

// Files that hold the samples of a header among them. A header that is damaged names none here;
// when its volume is read it is refused with its reason.
std::set<std::filesystem::path> data_of(const std::vector<FoundVolume>& found,
                                        const std::vector<ArchiveMember>& members) {
  std::set<std::filesystem::path> data;
  for (const auto& [member, reader] : found) {
    if (reader->data_names == nullptr) continue;
    const Companions companions = companions_of(member, members);
    try {
      for (const std::string& name : reader->data_names(InputFile(member.path), companions)) {
        data.insert(companion(name, companions));
      }
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnusableVolume) throw;
    }
  }
  return data;
}

// What an archive holds: volumes of a file each, with their data files, and one of all slices.
struct Contents {
  std::vector<FoundVolume> volumes;
  std::vector<ArchiveMember> slices;
  const Reader* slice_reader = nullptr;
  // Files that are no volume; they are told as ignored beside slices.
  std::vector<ArchiveMember> others;
};

Contents contents_of(const std::vector<ArchiveMember>& members) {
  const std::vector<FoundVolume> found = files_of_formats(members);
  const std::set<std::filesystem::path> data = data_of(found, members);
  Contents contents;
  std::set<std::filesystem::path> taken = data;
  for (const FoundVolume& volume : found) {
    if (data.contains(volume.member.path)) continue;
    taken.insert(volume.member.path);
    if (volume.reader->content == Content::kSlices) {
      contents.slice_reader = volume.reader;
      contents.slices.push_back(volume.member);
    } else {
      contents.volumes.push_back(volume);
    }
  }
  for (const ArchiveMember& member : members) {
    if (!taken.contains(member.path)) contents.others.push_back(member);
  }
  return contents;
}

Volume read_slices(const Contents& contents, const Input& input) {
  if (input.listener) input.listener(contents.slice_reader->name);
  std::vector<std::filesystem::path> files;
  for (const auto* members : {&contents.slices, &contents.others}) {
    for (const ArchiveMember& member : *members) files.push_back(member.path);
  }
  Volume volume = import_dicom(files, input.task);
  volume.format = contents.slice_reader->name;
  return volume;
}

Volume read_file(const FoundVolume& found, const std::vector<ArchiveMember>& members,
                 const Input& input) {
  const auto& [member, reader] = found;
  Volume volume = read_input(*reader, {.path = member.path,
                                       .companions = companions_of(member, members),
                                       .task = input.task,
                                       .listener = input.listener});
  volume.name = std::string(base_of(member.name));
  return volume;
}

// Leaves it to the client which of several is to be read.
[[noreturn]] void offer_members(const Contents& contents, const std::string& asked) {
  std::vector<Choice> choices;
  if (!contents.slices.empty()) {
    choices.push_back({"member", std::string(process::kDicomMember),
                       std::to_string(contents.slices.size()) + " DICOM files"});
  }
  for (const auto& [member, reader] : contents.volumes) {
    choices.push_back({"member", member.name, std::string(reader->title)});
  }
  std::string names;
  constexpr std::size_t kMost = 10;
  for (std::size_t at = 0; at < std::min(kMost, choices.size()); ++at) {
    names += (at > 0 ? ", " : "") + in_quotes(choices[at].value);
  }
  if (choices.size() > kMost) names += " and " + std::to_string(choices.size() - kMost) + " more";
  const std::string reason =
      asked.empty()
          ? "The archive holds " + std::to_string(choices.size()) +
                " volumes, where one is needed; choose one with member=NAME: " + names + "."
          : "The archive has no volume " + in_quotes(asked) + ", but: " + names + ".";
  throw_choice(reason, std::move(choices));
}

Volume read_members(const std::vector<ArchiveMember>& members, const Input& input) {
  const Contents contents = contents_of(members);
  const std::string& asked = input.task.options.member;
  const std::size_t count = contents.volumes.size() + (contents.slices.empty() ? 0 : 1);
  if (count == 0) {
    throw Error(ErrorCode::kUnsupportedMedia, "None of the archive's " +
                                                  std::to_string(members.size()) +
                                                  " files is a volume of a format that is read.");
  }
  if (!contents.slices.empty() &&
      (asked == process::kDicomMember || (asked.empty() && count == 1))) {
    return read_slices(contents, input);
  }
  if (asked.empty() && count == 1) return read_file(contents.volumes.front(), members, input);
  const auto found = std::ranges::find_if(
      contents.volumes, [&](const FoundVolume& volume) { return volume.member.name == asked; });
  if (found == contents.volumes.end()) offer_members(contents, asked);
  return read_file(*found, members, input);
}

}  // namespace

bool is_archive(std::string_view head) { return is_zip(head) || is_tar(head); }

Volume parse_archive(const Input& input) {
  const MembersFolder folder(input.task.scratch);
  return read_members(unpack(input.path, folder.path(), limits_of(input.task.limits)), input);
}

std::uint64_t most_archive_bytes(const InputFile& file, const SizeLimits& limits,
                                 const ImportOptions& /*options*/) {
  return std::min(limits_of(limits).max_bytes + kHeadroomBytes, most_unpacked_bytes(file.size()));
}

}  // namespace isomesh::import
