#include "server/volume/import.h"

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include <unistd.h>

#include "proto/error.h"
#include "server/volume/archive.h"
#include "server/volume/dicom/import.h"
#include "server/volume/files.h"
#include "server/volume/geometry.h"
#include "server/volume/gzip.h"
#include "server/volume/metaimage.h"
#include "server/volume/nifti.h"
#include "server/volume/nrrd.h"
#include "server/volume/payload.h"
#include "server/volume/raw.h"
#include "server/volume/sniff.h"
#include "server/volume/source.h"
#include "server/volume/text.h"
#include "server/volume/transfer.h"
#include "server/volume/vti.h"

namespace isomesh::volume {
namespace {

// Room for headers, and for what some programs leave behind the samples.
constexpr std::uint64_t kHeadroomBytes = std::uint64_t{1} << 20;

std::optional<FileFormat> format_of(const InputFile& file) {
  const std::string head = file.text(0, kSniffBytes);
  return sniff(std::as_bytes(std::span(head)));
}

bool is_compressed(const InputFile& file) {
  const std::string head = file.text(0, kSniffBytes);
  return is_gzip(std::as_bytes(std::span(head)));
}

void check_limits(const SourceVolume& volume, const ImportLimits& limits) {
  check_limits(volume.sample_count(), canonical_type(volume.layout), limits);
}

// A header inside gzip tells how much there should be; a bomb is more.
std::uint64_t most_inflated_bytes(FileFormat format, const InputFile& file,
                                  const ImportLimits& limits) {
  if (format != FileFormat::kNifti) return limits.max_sample_bytes + kHeadroomBytes;
  const std::string head = file.text(0, kSniffBytes);
  const SourceVolume volume =
      parse_nifti(inflate_head(std::as_bytes(std::span(head)), kNiftiHeaderBytes));
  check_limits(volume, limits);
  return volume.payload.offset + volume.stored_bytes() + kHeadroomBytes;
}

void gunzip(const InputFile& file, std::uint64_t limit, ScratchFile& target) {
  const std::uint64_t bytes =
      inflate_range(file, {0, file.size()}, limit,
                    [&](std::span<const std::byte> piece) { target.write(piece); });
  if (bytes > limit) {
    throw_unusable("The compressed file holds more than the " + std::to_string(limit) +
                   " bytes that its volume can have.");
  }
}

Geometry usable_geometry(const SourceVolume& source) {
  const Geometry geometry = normalised(source.geometry);
  if (const auto fault = find_fault(source.dims, geometry)) {
    throw_unusable("The file's geometry cannot be used: " + fault->message + ".");
  }
  return geometry;
}

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

struct FoundVolume {
  ArchiveMember member;
  FileFormat format = FileFormat::kNifti;
};

std::vector<FoundVolume> volumes_among(const std::vector<ArchiveMember>& members) {
  std::vector<FoundVolume> volumes;
  for (const ArchiveMember& member : members) {
    const auto format = format_of(InputFile(member.path));
    if (!format) continue;
    if (*format == FileFormat::kArchive) {
      throw_unusable("The archive holds another archive, " + in_quotes(member.name) +
                     "; send that one by itself.");
    }
    volumes.push_back({member, *format});
  }
  return volumes;
}

bool is_dicom_file(const FoundVolume& volume) { return volume.format == FileFormat::kDicom; }

// A list for a person; what is beyond the first few is counted.
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

class Import {
 public:
  Import(const ImportTask& task, const FormatListener& listener)
      : task_(task), listener_(listener) {}

  Volume run() const {
    if (task_.options.raw) {
      tell("raw");
      return import_raw(task_.source, *task_.options.raw, task_.limits, task_.target);
    }
    const auto format = format_of(InputFile(task_.source));
    if (!format) {
      throw Error(
          ErrorCode::kUnsupportedMedia,
          "The file is not NIfTI, NRRD, MetaImage, VTI, DICOM, nor a ZIP or TAR of one; raw "
          "samples need dims and type.");
    }
    if (*format == FileFormat::kArchive) return import_archive();
    return import_one(task_.source, *format, {});
  }

 private:
  void tell(std::string_view format) const {
    if (listener_) listener_(format);
  }

  // One file, compressed as a whole or not, with the files that its header may name.
  Volume import_one(const std::filesystem::path& path, FileFormat format,
                    const Companions& companions) const {
    tell(to_string(format));
    if (format != FileFormat::kDicom && !task_.options.series.empty()) {
      throw invalid_parameter("series", "chooses among DICOM series, and this is no DICOM");
    }
    const InputFile file(path);
    if (!is_compressed(file)) return import_plain(path, format, companions);
    ScratchFile plain(task_.scratch, ".plain");
    gunzip(file, most_inflated_bytes(format, file, task_.limits), plain);
    return import_plain(plain.path(), format, companions);
  }

  Volume import_plain(const std::filesystem::path& path, FileFormat format,
                      const Companions& companions) const {
    if (format == FileFormat::kDicom) return import_series(std::array{path});
    const InputFile file(path);
    const SourceVolume source = parse(file, format, companions);
    Volume volume;
    volume.format = to_string(format);
    volume.dims = source.dims;
    volume.geometry = usable_geometry(source);
    // A raw file that is too short is told so, whatever its header makes believe.
    if (source.encoding != Encoding::kRaw) check_limits(source, task_.limits);
    const Payload payload(file, source, task_.scratch);
    check_limits(source, task_.limits);
    return write_canonical({payload.file(), payload.offset(), payload.layout()}, volume,
                           task_.target);
  }

  SourceVolume parse(const InputFile& file, FileFormat format, const Companions& companions) const {
    switch (format) {
      case FileFormat::kNifti:
        return parse_nifti(file.text(0, kNiftiHeaderBytes));
      case FileFormat::kNrrd:
        return parse_nrrd(file, companions, task_.scratch);
      case FileFormat::kMetaImage:
        return parse_metaimage(file, companions, task_.scratch);
      case FileFormat::kVti:
        return parse_vti(file);
      case FileFormat::kDicom:
      case FileFormat::kArchive:
        break;
    }
    throw Error(ErrorCode::kInternal, "A format without a reader.");
  }

  Volume import_series(std::span<const std::filesystem::path> files) const {
    return import_dicom(files, task_.options.series, task_.limits, task_.target);
  }

  Volume import_archive() const {
    tell("archive");
    const InputFile file(task_.source);
    const ArchiveLimits limits = {.max_bytes = task_.limits.max_sample_bytes + kHeadroomBytes};
    const MembersFolder folder(task_.scratch);
    std::vector<ArchiveMember> members;
    if (is_compressed(file)) {
      // As a whole first, because the checksum of all of it comes last.
      ScratchFile plain(task_.scratch, ".tar");
      gunzip(file, std::min(limits.max_bytes + kHeadroomBytes, most_unpacked_bytes(file.size())),
             plain);
      members = unpack(plain.path(), folder.path(), limits);
    } else {
      members = unpack(task_.source, folder.path(), limits);
    }
    return import_members(members);
  }

  Volume import_members(const std::vector<ArchiveMember>& members) const {
    const std::vector<FoundVolume> volumes = volumes_among(members);
    if (volumes.empty()) {
      throw Error(ErrorCode::kUnsupportedMedia, "None of the archive's " +
                                                    std::to_string(members.size()) +
                                                    " files is a volume of a format that is read.");
    }
    if (std::ranges::any_of(volumes, is_dicom_file)) return import_all_dicom(members);
    if (volumes.size() > 1) {
      throw_unusable("The archive holds " + std::to_string(volumes.size()) +
                     " volumes, where one is needed: " + names_of(volumes) + ".");
    }
    const auto& [member, format] = volumes.front();
    return import_one(member.path, format, companions_of(member, members));
  }

  // With what lies among the slices and is no DICOM, be it a volume that somebody has made of them:
  // that it was left out is said in the answer.
  Volume import_all_dicom(const std::vector<ArchiveMember>& members) const {
    tell(to_string(FileFormat::kDicom));
    std::vector<std::filesystem::path> files;
    files.reserve(members.size());
    for (const ArchiveMember& member : members) files.push_back(member.path);
    return import_series(files);
  }

  const ImportTask& task_;
  const FormatListener& listener_;
};

}  // namespace

Volume import_volume(const ImportTask& task, const FormatListener& listener) {
  return Import(task, listener).run();
}

}  // namespace isomesh::volume
