// PNG images of grey samples (https://www.w3.org/TR/png-3).
#pragma once

#include <string_view>

#include "base/files.h"
#include "server/import/images/page.h"

namespace isomesh::import {

bool is_png(std::string_view head);

// Reads the stored samples, whatever gamma the image has. Throws Error kUnusableVolume, also for
// colours, transparency, fewer than 8 bits and interlaced images.
void read_png(const InputFile& file, const PageCheck& check, const PageSink& sink);

}  // namespace isomesh::import
