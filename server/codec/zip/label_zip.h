// One file of each label, together in a ZIP.
#pragma once

#include <map>
#include <span>
#include <vector>

#include "proto/types.h"
#include "server/codec/encode_labels.h"

namespace isomesh::codec {

using LabelFiles = std::map<MeshFormat, LabelFile>;

// Writes a ZIP with a file of each label in each of the formats, stored as they are: so each is
// also a range of the ZIP's bytes. A file holds one label's own surface, closed if the walls are,
// and is called by the label's title; where titles are alike, with its value behind it. Of Draco
// all files share one grid: what two labels have in common decodes to the same bits. Returns each
// label's files without their paths. Throws as the formats' encoders do, and Error kInternal when
// the library that writes ZIPs refuses.
std::vector<LabelFiles> encode_labels_zip(const LabelledSurface& surface,
                                          std::span<const MeshFormat> formats,
                                          const Provenance& provenance,
                                          const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
