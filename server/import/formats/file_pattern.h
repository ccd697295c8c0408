// Patterns by which a header names its data files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

bool is_file_pattern(std::string_view said);

// The names that "slice%03d.raw 1 93 2" stands for. The words are a name with one place for a whole
// number, as C's printf writes it, then the first number, the last and the step, which is 1 where
// it is missing and may be negative. NRRD's fifth word, the dimension of each file, is passed over,
// because every file holds the same share of the samples whatever it says. Throws Error
// kUnusableVolume for anything else.
std::vector<std::string> expand_file_pattern(std::string_view said);

}  // namespace isomesh::import
