// The order of numbered files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace isomesh::import {

// True if `one` comes first, with numbers in the names compared by value: "a9.png" before
// "a10.png".
bool comes_before(std::string_view one, std::string_view other);

// The first name that is missing in the sorted names, if these differ in one number only, which
// grows by a constant step otherwise. Empty if none is missing.
std::string missing_between(const std::vector<std::string>& sorted);

}  // namespace isomesh::import
