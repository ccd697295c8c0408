// Bytes -> elements (DICOM PS3.5, chapter 7, and PS3.10).
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/volume/dicom/dataset.h"

namespace isomesh::volume::dicom {

// True for two capital letters, which is what a value representation (PS3.5, 6.2) is.
bool is_representation(std::string_view text);

// True for those whose length has 16 bits; all others, and all to come, have 32 after two reserved
// bytes.
bool has_short_length(std::string_view vr);

// The group 0002, if it stands at `offset`. Throws Error kUnusableVolume.
MetaInformation parse_meta_information(const InputFile& file, std::uint64_t offset);

struct ParsedFile {
  DataSet data;
  std::optional<PixelElement> pixels;
};

// The data set from `offset` on, up to its pixels; nothing that a volume needs follows them.
// Whether value representations are written out is seen from the first element, because some
// writers tell the wrong syntax. Throws Error kUnusableVolume when an element reaches beyond what
// surrounds it, sequences lie too deep in one another, or there are too many elements.
ParsedFile parse_data_set(const InputFile& file, std::uint64_t offset,
                          std::string_view transfer_syntax);

}  // namespace isomesh::volume::dicom
