// The interface between import and its formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/files.h"
#include "proto/types.h"
#include "server/import/source/names.h"
#include "server/import/source/source.h"

namespace isomesh::import {

// The number of leading bytes that identify a format.
inline constexpr std::size_t kSniffBytes = 4096;

// Room for headers, and for trailing bytes of some programs.
inline constexpr std::uint64_t kHeadroomBytes = std::uint64_t{1} << 20;

// Called with the name of each format before a file of it is read: "archive", then "nifti", ...
using FormatListener = std::function<void(std::string_view format)>;

// A file to read, already decompressed.
struct Input {
  std::filesystem::path path;
  Companions companions;
  const ImportTask& task;
  const FormatListener& listener;
};

// The content of a file: a volume, slices of a volume, pages of which a stack of files is a volume,
// or other files.
enum class Content { kVolume, kSlices, kPages, kFiles };

// How to read a format; readers.cpp lists all of them.
struct Reader {
  // A row of proto/volume_formats.h, or "archive", which is no volume format.
  std::string_view name;
  Content content = Content::kVolume;
  // Recognises the beginning of a file. Null for raw samples, which have no signature.
  bool (*sniff)(std::string_view head) = nullptr;
  // False for a file that is recognised but cannot hold a volume, by its beginning, such as a
  // surface. An archive may hold it beside a volume. Null if all may.
  bool (*may_hold_volume)(std::string_view head) = nullptr;
  // Reads the header and places the samples; the options select one of several volumes. Throws
  // Error kUnusableVolume. Null for formats with `parse`.
  SourceVolume (*describe)(const InputFile& file, const Companions& companions,
                           const ImportOptions& options) = nullptr;
  // Reads the input and writes the task's target. Throws as import_volume does.
  Volume (*parse)(const Input& input) = nullptr;
  // The largest possible size of a file, by its plain beginning: the whole file or at least its
  // first kBeginningBytes. Null for archives and raw samples, and if `describe` says it: a header
  // in front of its samples. Throws as import_volume does.
  MostBytes (*most_bytes)(const InputFile& beginning, const ImportTask& task) = nullptr;
  // The companions that hold a header's samples and are therefore not volumes of their own. Null
  // for formats without data files. Throws as import_volume does.
  std::vector<std::string> (*data_names)(const InputFile& file,
                                         const Companions& companions) = nullptr;
};

}  // namespace isomesh::import
