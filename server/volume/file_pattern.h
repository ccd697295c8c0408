// Names of data files that a header tells by a pattern.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::volume {

bool is_file_pattern(std::string_view said);

// "slice%03d.raw 1 93 2": a name with one place for a whole number as C's printf writes it, the
// first number, the last, and the step between them, which is 1 unless it is told and may be
// negative. NRRD's fifth word, how many dimensions a file has, is passed over: files hold equal
// shares in the order of the samples whatever it says. Throws Error kUnusableVolume for anything
// else.
std::vector<std::string> expand_file_pattern(std::string_view said);

}  // namespace isomesh::volume
