// Raw samples, described by the request.
#pragma once

#include "server/import/source/reader.h"

namespace isomesh::import {

// Imports the samples that the task's options describe. Throws Error kInvalidParameter if the
// description is invalid or does not match the body's size; kTooLarge, kUnusableVolume,
// kOutOfSpace, kInternal as import_volume does.
Volume parse_raw(const Input& input);

}  // namespace isomesh::import
