#pragma once

#include <string>
#include <vector>

namespace isomesh::command_line {

// The name that `text` is most likely a misspelling of; empty if none is close.
std::string closest_to(const std::string& text, const std::vector<std::string>& names);

}  // namespace isomesh::command_line
