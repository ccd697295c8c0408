// Raw samples, which a request describes.
#pragma once

#include "server/import/source/reader.h"

namespace isomesh::import {

// Writes the samples that the task's options describe. Throws Error kInvalidParameter when the
// description is none of a volume or the body's size is not what it tells; kTooLarge,
// kUnusableVolume, kOutOfSpace, kInternal as import_volume does.
Volume parse_raw(const Input& input);

}  // namespace isomesh::import
