// What an import has to know about a format.
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

// How many leading bytes of a file tell its format.
inline constexpr std::size_t kSniffBytes = 4096;

// Room for headers, and for what some programs leave behind the samples.
inline constexpr std::uint64_t kHeadroomBytes = std::uint64_t{1} << 20;

// Called with the name of each format before a file of it is read: "archive", then "nifti", ...
using FormatListener = std::function<void(std::string_view format)>;

// A file that is to be read, no longer compressed as a whole.
struct Input {
  std::filesystem::path path;
  Companions companions;
  const ImportTask& task;
  const FormatListener& listener;
};

// What one file of a format holds: a volume, slices that make one together with those of other
// files, or other files.
enum class Content { kVolume, kSlices, kFiles };

// One row of the table in readers.cpp.
struct Reader {
  std::string_view name;   // that of the API; "archive" is none of a volume
  std::string_view title;  // for a person
  Content content = Content::kVolume;
  // Whether a file of the format begins so. Null for raw samples, which look like anything.
  bool (*sniff)(std::string_view head) = nullptr;
  // Reads the input and writes the task's target. Throws as import_volume does.
  Volume (*parse)(const Input& input) = nullptr;
  // How many bytes may come with such a beginning, which is plain: all of the file, or at least the
  // first kBeginningBytes of it. Null for archives and raw samples. Throws as `parse` does.
  MostBytes (*most_bytes)(const InputFile& beginning, const ImportTask& task) = nullptr;
  // The companions that hold the samples of a header, so that they are no volumes of their own.
  // Null for formats whose headers name none. Throws as `parse` does.
  std::vector<std::string> (*data_names)(const InputFile& file,
                                         const Companions& companions) = nullptr;
};

}  // namespace isomesh::import
