// What ITK makes of a header's words about space.
#pragma once

#include <filesystem>
#include <string>

#include "proto/types.h"
#include "server/volume/sniff.h"

namespace isomesh::volume {

// The geometry that ITK's reader of the format (kNrrd or kMetaImage) finds in a header, in the
// units of that header: axes beyond the third are left out, those that are missing are ITK's
// defaults. ITK reads more than it should from files that it is given: names of other files, sizes
// to allocate. So `header` must be one that we wrote of fields that we have checked, with at least
// one dimension; it is put into `scratch` and taken away again. Throws Error kUnusableVolume when
// ITK refuses the header or finds geometry of another kind than a volume's. Thread safe.
Geometry read_itk_geometry(FileFormat format, const std::string& header,
                           const std::filesystem::path& scratch);

}  // namespace isomesh::volume
