#pragma once

#include <string>

namespace isomesh::volume {

// Throws Error kUnusableVolume with the reason, a sentence.
[[noreturn]] void throw_unusable(const std::string& reason);

}  // namespace isomesh::volume
