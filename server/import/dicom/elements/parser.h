// Bytes -> elements (DICOM PS3.5, chapter 7, and PS3.10).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/files.h"
#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// True for two capital letters, the form of a value representation (PS3.5, 6.2).
bool is_representation(std::string_view text);

// True for value representations with 16-bit lengths. All others, also future ones, have 32-bit
// lengths after two reserved bytes.
bool has_short_length(std::string_view vr);

// Reads group 0002 if it is at `offset`. Throws Error kUnusableVolume.
MetaInformation parse_meta_information(const InputFile& file, std::uint64_t offset);

struct ParsedFile {
  DataSet data;
  std::optional<PixelElement> pixels;
};

// Reads the data set from `offset` up to its pixels; volumes need no later element. The first
// element decides whether value representations are explicit, because some writers declare the
// wrong syntax. Throws Error kUnusableVolume if an element exceeds its sequence or file, sequences
// are nested too deeply, or there are too many elements.
ParsedFile parse_data_set(const InputFile& file, std::uint64_t offset,
                          std::string_view transfer_syntax);

// Reads the elements of a data set, possibly truncated, as far as possible. Never throws because of
// the bytes.
DataSet parse_beginning(const InputFile& file, std::uint64_t offset,
                        std::string_view transfer_syntax);

}  // namespace isomesh::import::dicom
