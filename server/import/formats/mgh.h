// FreeSurfer's MGH volumes, .mgh and .mgz
// (https://surfer.nmr.mgh.harvard.edu/fswiki/FsTutorial/MghFormat).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/source/reader.h"
#include "server/import/source/source.h"

namespace isomesh::import {

bool is_mgh(std::string_view head);

// Reads the header. The direction cosines and the centre place the samples (vox2ras); without them
// FreeSurfer's coronal axes are assumed, with a note. The options select one of several frames.
// Ignores the tags behind the samples. Throws Error kUnusableVolume.
SourceVolume parse_mgh(const InputFile& file, const Companions& companions,
                       const ImportOptions& options);

}  // namespace isomesh::import
