// A PACS's responses to searches and uploads: DICOM JSON (PS3.18, F).
#pragma once

#include <filesystem>

#include "server/import/message/import_message.h"

namespace isomesh::import {

// Reads a response of QIDO-RS (a list of objects) or STOW-RS (one object with stored and failed
// instances). An empty file is an empty list. Throws Error kInvalidParameter for anything else.
PeersResponse read_response(const std::filesystem::path& file);

}  // namespace isomesh::import
