// USDZ ("USDZ File Format Specification", version 1.3, openusd.org): a ZIP of files that are not
// compressed and begin at multiples of 64 bytes.
#pragma once

#include "server/codec/encode.h"
#include "server/codec/encode_labels.h"

namespace isomesh::codec {

// A package with one file, which is a USDA of the surface, or of all labels (usda.h). Its size and
// checksum stand before it, so it is formatted twice and never held in memory. The bytes do not
// depend on the number of threads. They throw as the encoders of USDA do, and Error kTooLarge from
// 4 GiB on: readers of USDZ do not know ZIP64.
void encode_usdz(const mesh::Mesh& mesh, const Provenance& provenance, const mesh::Context& context,
                 const Sink& sink);
void encode_labels_usdz(const LabelledSurface& surface, const Provenance& provenance,
                        const mesh::Context& context, const Sink& sink);

}  // namespace isomesh::codec
