// Erases files of patients as soon as no record needs them.
#pragma once

#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/volume_store.h"

namespace isomesh::orders {

// Erases those of the blobs that no record names any more: they contain names of patients. `stored`
// lists blobs that the caller has stored, once for each time (BlobStore::mark_named); they are
// erased, too, unless they are named by now. Errors are only logged: a sweep removes these blobs
// later.
void erase_unnamed(store::BlobStore& blobs, const store::VolumeStore& volumes,
                   std::vector<std::string> keys, const std::vector<std::string>& stored = {});

}  // namespace isomesh::orders
