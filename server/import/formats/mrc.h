// MRC2014 and CCP4 maps, .mrc and .map (https://www.ccpem.ac.uk/mrc_format/mrc2014.php).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_mrc(std::string_view head);

// Reads the header. Coordinates stay in angstrom, with a note. Sections are ordered by the axes
// that the header names; cell angles shear the lattice. The origin is ORIGIN, or, if that is zero,
// the position of the first sample in the cell (NXSTART ...). The options select a volume of a
// stack (space group 401). Throws Error kUnusableVolume, also for stacks of images.
SourceVolume parse_mrc(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

}  // namespace isomesh::import
