// Bytes -> elements (DICOM PS3.5, chapter 7, and PS3.10).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/files.h"
#include "server/import/dicom/elements/dataset.h"

namespace isomesh::import::dicom {

// True for two capital letters, which is what a value representation (PS3.5, 6.2) is.
bool is_representation(std::string_view text);

// True for a value representation whose length has 16 bits. All others, and all that the standard
// will add, have 32 bits after two reserved bytes.
bool has_short_length(std::string_view vr);

// The group 0002, if it stands at `offset`. Throws Error kUnusableVolume.
MetaInformation parse_meta_information(const InputFile& file, std::uint64_t offset);

struct ParsedFile {
  DataSet data;
  std::optional<PixelElement> pixels;
};

// Reads the data set from `offset` on, up to its pixels; nothing that a volume needs follows them.
// The first element decides whether value representations are explicit, because some writers tell
// the wrong syntax. Throws Error kUnusableVolume when an element reaches beyond the sequence or
// file that holds it, sequences are nested too deeply, or there are too many elements.
ParsedFile parse_data_set(const InputFile& file, std::uint64_t offset,
                          std::string_view transfer_syntax);

// The elements of a data set of which the file may hold only the beginning, as far as they can be
// read; never throws because of the bytes.
DataSet parse_beginning(const InputFile& file, std::uint64_t offset,
                        std::string_view transfer_syntax);

}  // namespace isomesh::import::dicom
