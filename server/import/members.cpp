#include "server/import/members.h"

#include <algorithm>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/text.h"
#include "proto/error.h"
#include "proto/volume_formats.h"
#include "server/import/archives/archive.h"
#include "server/import/dicom/import.h"
#include "server/import/formats/format_readers.h"
#include "server/import/images/natural_order.h"
#include "server/import/images/stack.h"
#include "server/import/labels_beside.h"
#include "server/import/masks.h"
#include "server/import/other_formats.h"
#include "server/import/readers.h"
#include "server/import/source/scratch_folder.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMostNamed = 100;

struct FoundVolume {
  ArchiveMember member;
  const Reader* reader = nullptr;
  std::vector<std::string> doubles = {};  // names of identical members
};

ArchiveLimits limits_of(const SizeLimits& limits) {
  return {.max_bytes = limits.max_sample_bytes + kHeadroomBytes};
}

// Slices and pages are always needed, and a Zarr's metadata name its data. For others this is not
// known yet; nor is the size of data files.
std::optional<std::uint64_t> most_of_slice(const std::filesystem::path& beginning,
                                           const ImportTask& task) {
  const InputFile file(beginning);
  const Reader* reader = sniff(file);
  const bool is_needed =
      reader != nullptr && (reader->content == Content::kSlices ||
                            reader->content == Content::kPages || reader->name == kZarrReader.name);
  if (!is_needed) return std::nullopt;
  return most_bytes_of(*reader, file, task).file;
}

// An archive's members; large ones are unpacked completely only if needed.
class Members {
 public:
  explicit Members(const Input& input)
      : input_(input),
        folder_(input.task.scratch, "members-"),
        all_(unpack(input.path, folder_.path(), limits_of(input.task.limits),
                    [&](const auto& beginning) { return most_of_slice(beginning, input.task); })) {
    for (const ArchiveMember& member : all_) {
      const std::filesystem::path name = member.name;
      files_.emplace(name.lexically_normal().generic_string(), member.path);
    }
  }

  const std::vector<ArchiveMember>& all() const { return all_; }

  Companions companions_of(const std::string& name) const { return {files_, name}; }

  // The files with a header's samples. Throws Error kUnusableVolume if they are missing.
  std::vector<std::filesystem::path> data_of(const FoundVolume& found) const;

  // Unpacks a volume and its data files completely, up to the sizes in its header.
  void complete(const FoundVolume& found);

 private:
  const Input& input_;
  TemporaryFolder folder_;
  std::vector<ArchiveMember> all_;
  ArchiveFiles files_;
};

std::vector<std::filesystem::path> Members::data_of(const FoundVolume& found) const {
  std::vector<std::filesystem::path> data;
  const auto& [member, reader, doubles] = found;
  const Companions companions = companions_of(member.name);
  for (const std::string& name :
       data_names_of(*reader, InputFile(member.path), companions, input_.task)) {
    data.push_back(companion(name, companions));
  }
  return data;
}

void Members::complete(const FoundVolume& found) {
  std::set<std::filesystem::path> cut;
  for (const ArchiveMember& member : all_) {
    if (!member.is_whole) cut.insert(member.path);
  }
  if (cut.empty()) return;
  const MostBytes most = most_bytes_of(*found.reader, InputFile(found.member.path), input_.task);
  std::map<std::filesystem::path, std::uint64_t> wanted;
  if (cut.contains(found.member.path)) wanted.emplace(found.member.path, most.file);
  for (const std::filesystem::path& data : data_of(found)) {
    if (cut.contains(data)) wanted.emplace(data, most.data);
  }
  if (wanted.empty()) return;
  unpack_whole(input_.path, all_, wanted, limits_of(input_.task.limits));
  for (ArchiveMember& member : all_) {
    if (wanted.contains(member.path)) member.is_whole = true;
  }
}

// True for files that only look like volumes: office documents are ZIPs, and VTK's files may hold
// surfaces.
bool is_beside(const Reader& reader, const InputFile& file) {
  return reader.content == Content::kFiles ||
         (reader.may_hold_volume != nullptr && !reader.may_hold_volume(file.text(0, kSniffBytes)));
}

std::vector<FoundVolume> files_of_formats(const std::vector<ArchiveMember>& members) {
  std::vector<FoundVolume> found;
  for (const ArchiveMember& member : members) {
    const InputFile file(member.path);
    const Reader* reader = sniff(file);
    if (reader != nullptr && !is_beside(*reader, file)) found.push_back({member, reader});
  }
  return found;
}

[[noreturn]] void throw_no_volume(const std::vector<ArchiveMember>& members) {
  for (const ArchiveMember& member : members) {
    const Reader* reader = sniff(InputFile(member.path));
    if (reader == nullptr || reader->content != Content::kFiles) continue;
    throw_unusable("The archive contains another archive, " + in_quotes(member.name) +
                   ". Send that one by itself.");
  }
  std::string known;
  for (const ArchiveMember& member : members) {
    const auto name = name_of_other_format(InputFile(member.path).text(0, kSniffBytes));
    if (!name) continue;
    known = ' ' + in_quotes(member.name) + " is " + std::string(*name) + ", which cannot be read.";
    break;
  }
  throw Error(ErrorCode::kUnsupportedMedia,
              "None of the " + std::to_string(members.size()) +
                  " files in the archive is a volume in a supported format." + known);
}

// The data files among the volumes found. A damaged header names none here; it is reported when its
// volume is read.
std::set<std::filesystem::path> data_of(const std::vector<FoundVolume>& found,
                                        const Members& members) {
  std::set<std::filesystem::path> all;
  for (const FoundVolume& volume : found) {
    try {
      for (const std::filesystem::path& data : members.data_of(volume)) all.insert(data);
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kUnusableVolume) throw;
    }
  }
  return all;
}

bool are_same(const FoundVolume& one, const FoundVolume& other, Members& members) {
  try {
    for (const FoundVolume* volume : {&one, &other}) members.complete(*volume);
    std::vector<std::filesystem::path> files = members.data_of(one);
    std::vector<std::filesystem::path> others = members.data_of(other);
    files.push_back(one.member.path);
    others.push_back(other.member.path);
    return std::ranges::equal(files, others, same_bytes);
  } catch (const Error& error) {
    // Unreadable files are reported later, under either name.
    if (describe(error.code()).status >= 500) throw;
    return false;
  }
}

// Removes duplicates. Files of one size with equal beginnings are only compared with the first of
// them, which bounds the work and suffices to find copies.
std::vector<FoundVolume> without_doubles(std::vector<FoundVolume> volumes, Members& members) {
  using Likeness = std::pair<std::uint64_t, std::size_t>;  // the size, and a hash of the beginning
  std::vector<FoundVolume> kept;
  std::map<Likeness, std::size_t> first_like_it;
  for (FoundVolume& volume : volumes) {
    const std::string beginning = InputFile(volume.member.path).text(0, kBeginningBytes);
    const Likeness likeness = {volume.member.bytes, std::hash<std::string>{}(beginning)};
    const auto [first, is_new] = first_like_it.try_emplace(likeness, kept.size());
    if (!is_new && are_same(kept[first->second], volume, members)) {
      kept[first->second].doubles.push_back(volume.member.name);
    } else {
      kept.push_back(std::move(volume));
    }
  }
  return kept;
}

// Images of one folder and format that are a volume together, or a file of several pages.
struct Stack {
  std::string name;  // of the file, or a pattern: "folder/*.png"
  const Reader* reader = nullptr;
  std::vector<ImageFile> files = {};
};

// An archive's content: volumes in one file each, with their data files, one volume of all slices,
// and, if there is nothing else, stacks of images.
struct Contents {
  std::vector<FoundVolume> volumes;
  std::vector<Stack> stacks;
  std::vector<ArchiveMember> slices;
  const Reader* slice_reader = nullptr;
  // Other files, listed as ignored.
  std::vector<ArchiveMember> others;
  // Pictures beside numbered ones, listed as ignored.
  std::vector<ArchiveMember> unnumbered;
};

using Pictures = std::vector<const FoundVolume*>;

void add_stack(const std::string& name, const Pictures& pictures, std::vector<Stack>& stacks) {
  Stack stack = {name, pictures.front()->reader};
  for (const FoundVolume* picture : pictures) {
    stack.files.push_back({picture->member.name, picture->member.path});
  }
  stacks.push_back(std::move(stack));
}

// A folder's pictures of one format.
void add_stacks(const std::string& pattern, const Pictures& pictures, Contents& contents) {
  std::vector<std::string> names;
  for (const FoundVolume* picture : pictures) {
    names.emplace_back(base_of(picture->member.name));
  }
  const NameGroups groups = groups_of(names);
  for (const std::vector<std::size_t>& volume : groups.volumes) {
    Pictures slices;
    for (const std::size_t at : volume) slices.push_back(pictures[at]);
    const std::string folder(folder_of(slices.front()->member.name));
    add_stack(groups.volumes.size() == 1 ? pattern : folder + name_pattern(names[volume.front()]),
              slices, contents.stacks);
  }
  for (const std::size_t at : groups.others) contents.unnumbered.push_back(pictures[at]->member);
}

void add_stacks(const std::vector<FoundVolume>& pages, Contents& contents) {
  std::map<std::string, Pictures> by_pattern;
  for (const FoundVolume& page : pages) {
    const auto& [member, reader, doubles] = page;
    if (has_pages(member.path)) {
      contents.stacks.push_back({member.name, reader, {{member.name, member.path}}});
    } else {
      by_pattern[std::string(folder_of(member.name)) + "*." + std::string(reader->name)].push_back(
          &page);
    }
  }
  for (const auto& [pattern, pictures] : by_pattern) add_stacks(pattern, pictures, contents);
}

// Pictures beside a volume are not volumes themselves.
void add_pages(const std::vector<FoundVolume>& pages, Contents& contents) {
  if (contents.volumes.empty() && contents.slices.empty()) {
    add_stacks(pages, contents);
    return;
  }
  for (const FoundVolume& page : pages) contents.others.push_back(page.member);
}

// Identical masks are two structures, or two empty ones, so they are no duplicates.
enum class Doubles { kLeaveOut, kKeep };

Contents contents_of(Members& members, Doubles doubles) {
  const std::vector<FoundVolume> found = files_of_formats(members.all());
  const std::set<std::filesystem::path> data = data_of(found, members);
  Contents contents;
  std::set<std::filesystem::path> taken = data;
  std::vector<FoundVolume> pages;
  for (const FoundVolume& volume : found) {
    if (data.contains(volume.member.path)) continue;
    taken.insert(volume.member.path);
    if (volume.reader->content == Content::kSlices) {
      contents.slice_reader = volume.reader;
      contents.slices.push_back(volume.member);
    } else if (volume.reader->content == Content::kPages) {
      pages.push_back(volume);
    } else {
      contents.volumes.push_back(volume);
    }
  }
  for (const ArchiveMember& member : members.all()) {
    if (!taken.contains(member.path)) contents.others.push_back(member);
  }
  if (doubles == Doubles::kLeaveOut) {
    contents.volumes = without_doubles(std::move(contents.volumes), members);
  }
  add_pages(pages, contents);
  return contents;
}

Volume read_slices(const Contents& contents, const Input& input) {
  if (input.listener) input.listener(contents.slice_reader->name);
  std::vector<NamedFile> files;
  for (const auto* members : {&contents.slices, &contents.others}) {
    for (const ArchiveMember& member : *members) files.push_back(named(member.path));
  }
  Volume volume = import_dicom(files, input.task);
  volume.format = contents.slice_reader->name;
  return volume;
}

// Lists files beside a volume as ignored, except tables of its labels.
void ignore(const Contents& contents, Volume& volume) {
  for (const ArchiveMember& other : contents.unnumbered) {
    if (volume.ignored.size() >= kMostNamed) return;
    volume.ignored.push_back(
        {printable(base_of(other.name)), "its name is not one of the numbered images beside it"});
  }
  const auto has_name = [](const LabelEntry& entry) { return !entry.name.empty(); };
  const bool has_names = std::ranges::any_of(volume.labels, has_name);
  for (const ArchiveMember& other : contents.others) {
    if (volume.ignored.size() >= kMostNamed) return;
    const bool is_table = is_label_table(other.path);
    if (is_table && has_names) continue;
    volume.ignored.push_back({printable(base_of(other.name)),
                              is_table ? "its names of labels were not used for this volume"
                                       : "it is not a volume in a supported format"});
  }
}

// A Zarr's name is that of its folder. At the top it has none, and gets that of the upload.
std::optional<std::string> volume_name(const ArchiveMember& member, const Reader& reader) {
  if (reader.name != "zarr") return std::string(base_of(member.name));
  const std::string_view folder = folder_of(member.name);
  if (folder.empty()) return std::nullopt;
  return std::string(base_of(folder.substr(0, folder.size() - 1)));
}

Volume read_file(const FoundVolume& found, const Contents& contents, Members& members,
                 const Input& input) {
  const auto& [member, reader, doubles] = found;
  members.complete(found);
  Volume volume = read_input(*reader, {.path = member.path,
                                       .companions = members.companions_of(member.name),
                                       .task = input.task,
                                       .listener = input.listener});
  volume.name = volume_name(member, *reader);
  if (!doubles.empty()) volume.notes.push_back(duplicate_note(doubles.size()));
  for (std::size_t at = 0; at < std::min(kMostNamed, doubles.size()); ++at) {
    volume.ignored.push_back({std::string(base_of(doubles[at])), reason_of_double(member.name)});
  }
  ignore(contents, volume);
  return volume;
}

Volume read_stack(const Stack& stack, const Contents& contents, const Members& members,
                  const Input& input) {
  if (input.listener) input.listener(stack.reader->name);
  Volume volume = import_images(stack.files, input.task);
  volume.format = stack.reader->name;
  take_labels_beside(members.companions_of(stack.files.front().name), input.task, volume);
  if (stack.files.size() == 1) volume.name = std::string(base_of(stack.name));
  ignore(contents, volume);
  return volume;
}

[[noreturn]] void offer_members(const Contents& contents, const std::string& asked) {
  std::vector<Choice> choices;
  if (!contents.slices.empty()) {
    choices.push_back({"member", std::string(kDicomMember),
                       std::to_string(contents.slices.size()) + " DICOM files"});
  }
  for (const auto& [member, reader, doubles] : contents.volumes) {
    choices.push_back({"member", member.name, std::string(volume_format(reader->name).title)});
  }
  for (const Stack& stack : contents.stacks) {
    choices.push_back({"member", stack.name,
                       std::to_string(stack.files.size()) + ' ' +
                           std::string(volume_format(stack.reader->name).title) +
                           (stack.files.size() == 1 ? " file" : " files")});
  }
  if (asked.empty() && choices.size() > volume::kMostChoices) {
    throw_unusable("The archive holds " + std::to_string(choices.size()) +
                   " volumes, more than the " + std::to_string(volume::kMostChoices) +
                   " that one upload may have. Send it in parts, or choose one with member=NAME.");
  }
  std::string names;
  constexpr std::size_t kMost = 10;
  for (std::size_t at = 0; at < std::min(kMost, choices.size()); ++at) {
    names += (at > 0 ? ", " : "") + in_quotes(choices[at].value);
  }
  if (choices.size() > kMost) names += " and " + std::to_string(choices.size() - kMost) + " more";
  const std::string reason = asked.empty()
                                 ? "The archive holds " + std::to_string(choices.size()) +
                                       " volumes. Choose one with member=NAME: " + names + "."
                                 : "The upload has no volume " + in_quotes(asked) +
                                       ". Choose one with member=NAME: " + names + ".";
  throw_choice(reason, std::move(choices));
}

Mask mask_of(const FoundVolume& found, Members& members) {
  const auto& [member, reader, doubles] = found;
  std::string file = member.name;
  if (reader->name == kZarrReader.name) {
    const std::string_view folder = folder_of(file);
    if (!folder.empty()) file = folder.substr(0, folder.size() - 1);
  }
  return {std::move(file), [&](const ImportTask& task) {
            static const FormatListener nobody;
            members.complete(found);
            // Only for the files that a header names: no table of labels belongs to a mask.
            const bool has_data = found.reader->data_names != nullptr;
            return read_input(
                *found.reader,
                {.path = found.member.path,
                 .companions = has_data ? members.companions_of(found.member.name) : Companions(),
                 .task = task,
                 .listener = nobody});
          }};
}

Volume read_masks(Members& members, const Input& input) {
  if (!input.task.options.member.empty()) {
    throw invalid_parameter("member", "cannot be combined with masks, which takes all members");
  }
  Contents contents = contents_of(members, Doubles::kKeep);
  if (!contents.slices.empty() || !contents.stacks.empty()) {
    throw_unusable(
        "A mask is one file with a whole volume, but the upload has DICOM files or images. Leave "
        "them out, or send the upload without masks.");
  }
  if (contents.volumes.empty()) throw_no_volume(members.all());
  std::ranges::sort(contents.volumes, [](const FoundVolume& one, const FoundVolume& other) {
    return comes_before(one.member.name, other.member.name);
  });
  if (input.listener) input.listener(contents.volumes.front().reader->name);
  std::vector<Mask> masks;
  for (const FoundVolume& found : contents.volumes) masks.push_back(mask_of(found, members));
  Volume volume = import_masks(masks, input.task);
  ignore(contents, volume);
  return volume;
}

Volume read_members(Members& members, const Input& input) {
  if (input.task.options.masks) return read_masks(members, input);
  const Contents contents = contents_of(members, Doubles::kLeaveOut);
  const std::string& asked = input.task.options.member;
  const std::size_t count =
      contents.volumes.size() + contents.stacks.size() + (contents.slices.empty() ? 0 : 1);
  if (count == 0) throw_no_volume(members.all());
  if (!contents.slices.empty() && (asked == kDicomMember || (asked.empty() && count == 1))) {
    return read_slices(contents, input);
  }
  const auto stack = std::ranges::find_if(contents.stacks, [&](const Stack& each) {
    return asked.empty() ? count == 1 : each.name == asked;
  });
  if (stack != contents.stacks.end()) return read_stack(*stack, contents, members, input);
  if (asked.empty() && count == 1) {
    return read_file(contents.volumes.front(), contents, members, input);
  }
  const auto found = std::ranges::find_if(contents.volumes, [&](const FoundVolume& volume) {
    return volume.member.name == asked || std::ranges::count(volume.doubles, asked) > 0;
  });
  if (found == contents.volumes.end()) offer_members(contents, asked);
  return read_file(*found, contents, members, input);
}

}  // namespace

bool is_archive(std::string_view head) { return is_zip(head) || is_tar(head); }

Volume parse_archive(const Input& input) {
  Members members(input);
  return read_members(members, input);
}

std::uint64_t most_archive_bytes(std::uint64_t compressed_bytes, const SizeLimits& limits) {
  return std::min(limits_of(limits).max_bytes + kHeadroomBytes,
                  most_unpacked_bytes(compressed_bytes));
}

}  // namespace isomesh::import
