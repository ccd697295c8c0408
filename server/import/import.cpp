#include "server/import/import.h"

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "base/files.h"
#include "proto/error.h"
#include "proto/volume_formats.h"
#include "server/import/archives/archive.h"
#include "server/import/other_formats.h"
#include "server/import/peers/series.h"
#include "server/import/readers.h"
#include "server/import/source/ct_presets.h"
#include "server/import/source/gzip.h"

namespace isomesh::import {
namespace {

// More than an empty TAR.
constexpr std::size_t kHeadBytes = 16384;

// Inflated if it is compressed. Throws if that fails: a damaged file may be of a known format.
std::string beginning_of(const InputFile& file) {
  std::string head = file.text(0, kHeadBytes);
  if (!is_gzip(head)) return head;
  inflate_range(file, {0, file.size()}, kSniffBytes, [](std::span<const std::byte>) {});
  return inflate_head(head, kHeadBytes);
}

[[noreturn]] void throw_unknown_format(const InputFile& file) {
  const std::string beginning = beginning_of(file);
  if (is_empty_tar(beginning)) throw_empty_archive();
  if (const auto name = name_of_other_format(beginning)) {
    throw Error(ErrorCode::kUnsupportedMedia,
                "This is " + std::string(*name) +
                    ", which cannot be read. Formats that can be read: " + volume_format_titles() +
                    ", or a ZIP or TAR of one, also compressed with gzip.");
  }
  throw Error(ErrorCode::kUnsupportedMedia,
              "The file is not " + volume_format_titles() +
                  ", or a ZIP or TAR of one. If it holds raw samples, give their dims (X,Y,Z) and "
                  "type.");
}

// Adds what the uploader says of the samples.
void add_modality(SaidModality modality, Volume& volume) {
  if (volume.format == "dicom") {
    throw invalid_parameter("modality",
                            "applies to files that do not tell their modality; DICOM does");
  }
  switch (modality) {
    case SaidModality::kCt:
      volume.modality = "CT";
      add_ct_presets(volume);
  }
}

Volume read_volume(const ImportTask& task, const FormatListener& listener) {
  const Input input = {.path = task.source, .companions = {}, .task = task, .listener = listener};
  if (task.options.raw) return read_raw_input(input);
  if (task.options.peers) return read_peers_series(task, listener);
  const InputFile file(task.source);
  const Reader* reader = sniff(file);
  if (reader == nullptr) throw_unknown_format(file);
  if (!task.options.member.empty() && reader->content != Content::kFiles) {
    throw invalid_parameter("member",
                            "selects a member of an archive, but this file is not an archive");
  }
  if (task.options.masks && reader->content != Content::kFiles) {
    throw invalid_parameter("masks",
                            "combines the masks of a folder or archive, but this is a single file. "
                            "Mesh its labels without it");
  }
  return read_input(*reader, input);
}

}  // namespace

Volume import_volume(const ImportTask& task, const FormatListener& listener) {
  Volume volume = read_volume(task, listener);
  if (task.options.modality) add_modality(*task.options.modality, volume);
  return volume;
}

}  // namespace isomesh::import
