// A series from a PACS -> one volume.
#pragma once

#include "proto/types.h"
#include "server/import/source/reader.h"

namespace isomesh::import {

// Reads the task's source, multipart/related with one DICOM file per part, as the series in the
// task's options. Duplicate objects are read once. Throws Error kSeriesIncomplete if it is
// truncated, or has objects of another series or study, or differs from the list of objects; and as
// import_volume does.
Volume read_peers_series(const ImportTask& task, const FormatListener& listener);

}  // namespace isomesh::import
