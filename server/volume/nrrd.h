// NRRD headers (https://teem.sourceforge.net/nrrd/format.html).
#pragma once

#include <filesystem>
#include <string_view>

#include "server/volume/source.h"

namespace isomesh::volume {

bool is_nrrd(std::string_view head);

// Reads the header, attached to its samples or in a file of its own. What it says about space is
// read by ITK; RAS and LAS become LPS. Of the other spaces those that are right-handed are taken as
// they are, because nothing says how they lie in the patient, and left-handed ones are refused.
// Throws Error kUnusableVolume.
SourceVolume parse_nrrd(const InputFile& file, const Companions& companions,
                        const std::filesystem::path& scratch);

}  // namespace isomesh::volume
