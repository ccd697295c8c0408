// Windows bitmaps, .bmp, of grey samples of 8 bits.
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/images/page.h"

namespace isomesh::import {

bool is_bmp(std::string_view head);

// Reads the picture from top to bottom. Throws Error kUnusableVolume, also for colours and
// compression.
void read_bmp(const InputFile& file, const PageCheck& check, const PageSink& sink);

}  // namespace isomesh::import
