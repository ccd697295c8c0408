// One file per label, together in a ZIP.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/codec/encode.h"

namespace isomesh::codec {

using LabelFiles = std::map<MeshFormat, LabelFile>;

// Writes a ZIP with a file per label and format, stored uncompressed, so each is also a byte range
// of the ZIP. A file holds one label's own surface, closed if the walls are, and is named by the
// label's title; equal titles get the label's value appended. All Draco files share one grid:
// shared walls decode to the same bits. Returns each label's files without their paths. Throws as
// the formats' encoders do, and Error kInternal if the ZIP library fails.
std::vector<LabelFiles> encode_labels_zip(const LabelledSurface& surface,
                                          std::span<const MeshFormat> formats,
                                          const Provenance& provenance,
                                          const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
