// Patterns for a header's data files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

bool is_file_pattern(std::string_view said);

// Expands "slice%03d.raw 1 93 2": a name with one integer conversion of C's printf, the first
// number, the last, and the step, which defaults to 1 and may be negative. NRRD's fifth word, the
// dimension of each file, is ignored: all files hold equal parts of the samples. Throws Error
// kUnusableVolume for anything else.
std::vector<std::string> expand_file_pattern(std::string_view said);

}  // namespace isomesh::import
