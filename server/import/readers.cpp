#include "server/import/readers.h"

#include <algorithm>

#include "proto/error.h"
#include "server/import/dicom/import.h"
#include "server/import/formats/format_readers.h"
#include "server/import/images/page.h"
#include "server/import/images/stack.h"
#include "server/import/images/tiff.h"
#include "server/import/labels_beside.h"
#include "server/import/members.h"
#include "server/import/samples/transfer.h"
#include "server/import/samples/volume_pictures.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {
namespace {

constexpr Reader kDicomReader = {.name = "dicom",
                                 .content = Content::kSlices,
                                 .sniff = is_dicom,
                                 .parse = parse_dicom,
                                 .most_bytes = most_dicom_bytes};

constexpr Reader image_reader(std::string_view name, bool (*sniff)(std::string_view head)) {
  return {.name = name,
          .content = Content::kPages,
          .sniff = sniff,
          .parse = parse_image,
          .most_bytes = most_image_bytes};
}

constexpr Reader kTiffReader = image_reader("tiff", is_tiff);
constexpr Reader kPngReader = image_reader("png", is_png);
constexpr Reader kBmpReader = image_reader("bmp", is_bmp);
constexpr Reader kArchiveReader = {
    .name = "archive", .content = Content::kFiles, .sniff = is_archive, .parse = parse_archive};

constexpr const Reader* kReaders[] = {
    &kRawReader, &kNiftiReader, &kNrrdReader, &kMetaImageReader, &kVtiReader, &kVtkLegacyReader,
    &kMghReader, &kAfniReader, &kParReader, &kIsqReader, &kMrcReader, &kCubeReader, &kNumpyReader,
    &kGiplReader, &kMifReader, &kZarrReader, &kHdf5Reader,
    // Before images: the preamble of a DICOM file may be the header of a TIFF file (PS3.10, 7.1).
    &kDicomReader, &kTiffReader, &kPngReader, &kBmpReader, &kArchiveReader};

const Reader* sniff_plain(std::string_view head) {
  const auto* found = std::ranges::find_if(kReaders, [&](const Reader* reader) {
    return reader->sniff != nullptr && reader->sniff(head);
  });
  return found == std::end(kReaders) ? nullptr : *found;
}

bool is_compressed(const InputFile& file) { return is_gzip(file.text(0, kSniffBytes)); }

void gunzip(const InputFile& file, std::uint64_t limit, ScratchFile& target) {
  const std::uint64_t bytes =
      inflate_range(file, {0, file.size()}, limit,
                    [&](std::span<const std::byte> piece) { target.write(piece); });
  if (bytes > limit) {
    throw_unusable("The compressed file unpacks to more than the " + std::to_string(limit) +
                   " bytes that its volume can have.");
  }
}

bool asks_for_volume(const Error& error) {
  const std::vector<Choice>& choices = error.remedy().choices;
  return !choices.empty() && choices.front().parameter == "volume";
}

ImportOptions with_first_volume(ImportOptions options) {
  options.volume = 0;
  return options;
}

SourceVolume described(const Reader& reader, const InputFile& file, const Input& input) {
  const ImportOptions& options = input.task.options;
  try {
    return reader.describe(file, input.companions, options);
  } catch (const Error& error) {
    if (!asks_for_volume(error)) throw;
    const SourceVolume first = reader.describe(file, input.companions, with_first_volume(options));
    throw with_pictures(error, file, first, input.task.scratch);
  }
}

Volume parse(const Reader& reader, const Input& input) {
  Volume volume;
  if (reader.describe != nullptr) {
    const InputFile file(input.path);
    const SourceVolume source = described(reader, file, input);
    volume = write_canonical(file, source, input.task);
  } else {
    volume = reader.parse(input);
  }
  if (reader.content == Content::kVolume) {
    take_labels_beside(input.companions, input.task, volume);
  }
  if (reader.content != Content::kFiles) volume.format = reader.name;
  return volume;
}

void tell(const Reader& reader, const Input& input) {
  if (input.listener) input.listener(reader.name);
}

// The inflated beginning of a compressed file, in a file of its own.
class InflatedBeginning {
 public:
  InflatedBeginning(const InputFile& file, const std::filesystem::path& scratch)
      : scratch_(scratch, ".beginning") {
    const std::string plain = inflate_head(file.text(0, kBeginningBytes), kBeginningBytes);
    scratch_.write(std::as_bytes(std::span(plain)));
  }

  InputFile file() const { return InputFile(scratch_.path()); }

 private:
  ScratchFile scratch_;
};

// By the plain beginning of a file. Formats with more data behind their samples get more room.
MostBytes most_plain_bytes(const Reader& reader, const InputFile& beginning,
                           const ImportTask& task) {
  if (reader.most_bytes != nullptr) return reader.most_bytes(beginning, task);
  constexpr std::uint64_t kFooterBytes = std::uint64_t{16} << 20;
  const SourceVolume volume = reader.describe(beginning, {}, task.options);
  check_limits(volume, task.limits);
  return {.file = volume.payload.offset + volume.most_encoded_bytes() + kHeadroomBytes +
                  (volume.has_footer ? kFooterBytes : 0)};
}

// The size is the same whichever volume of several is chosen. The question which one comes with
// pictures of all, for which the whole file is needed.
MostBytes most_of_any_volume(const Reader& reader, const InputFile& beginning, ImportTask task) {
  try {
    return most_plain_bytes(reader, beginning, task);
  } catch (const Error& error) {
    if (!asks_for_volume(error)) throw;
    task.options = with_first_volume(task.options);
    return most_plain_bytes(reader, beginning, task);
  }
}

// The largest inflated size of a compressed file; larger ones are rejected as bombs.
std::uint64_t most_inflated_bytes(const Reader& reader, const InputFile& file,
                                  const ImportTask& task) {
  if (reader.content == Content::kFiles) return most_archive_bytes(file.size(), task.limits);
  const InflatedBeginning beginning(file, task.scratch);
  return most_of_any_volume(reader, beginning.file(), task).file;
}

void check_options(const Reader& reader, const ImportOptions& options) {
  const bool is_volume = reader.content == Content::kVolume;
  if (is_volume && !options.series.empty()) {
    throw invalid_parameter("series", "selects a DICOM series, but this file is not DICOM");
  }
  if (options.nifti_form && reader.content != Content::kFiles && reader.name != "nifti") {
    throw invalid_parameter("nifti_form", "applies to NIfTI files, but this file is not NIfTI");
  }
}

}  // namespace

std::span<const Reader* const> readers() { return kReaders; }

const Reader* sniff(std::string_view head) {
  if (is_gzip(head)) return sniff_plain(inflate_head(head, kSniffBytes));
  return sniff_plain(head);
}

const Reader* sniff(const InputFile& file) { return sniff(file.text(0, kSniffBytes)); }

MostBytes most_bytes_of(const Reader& reader, const InputFile& beginning, const ImportTask& task) {
  if (!is_compressed(beginning)) return most_of_any_volume(reader, beginning, task);
  const InflatedBeginning plain(beginning, task.scratch);
  MostBytes most = most_of_any_volume(reader, plain.file(), task);
  // Deflate stores incompressible data with a few extra bytes per block.
  constexpr std::uint64_t kStoredShare = 100;
  most.file += most.file / kStoredShare;
  return most;
}

std::vector<std::string> data_names_of(const Reader& reader, const InputFile& beginning,
                                       const Companions& companions, const ImportTask& task) {
  if (reader.data_names == nullptr) return {};
  if (!is_compressed(beginning)) return reader.data_names(beginning, companions);
  const InflatedBeginning plain(beginning, task.scratch);
  return reader.data_names(plain.file(), companions);
}

Volume read_input(const Reader& reader, Input input) {
  tell(reader, input);
  check_options(reader, input.task.options);
  const InputFile file(input.path);
  if (!is_compressed(file)) return parse(reader, input);
  const std::uint64_t most = most_inflated_bytes(reader, file, input.task);
  ScratchFile plain(input.task.scratch, ".plain");
  gunzip(file, most, plain);
  input.path = plain.path();
  return parse(reader, input);
}

Volume read_raw_input(const Input& input) {
  tell(kRawReader, input);
  return parse(kRawReader, input);
}

}  // namespace isomesh::import
