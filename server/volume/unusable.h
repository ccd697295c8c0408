// Throws Error kUnusableVolume with a sentence as its reason.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "base/error.h"
#include "proto/notes.h"

namespace isomesh::volume {

[[noreturn]] void throw_unusable(const std::string& reason);

// For a stored volume whose bytes have changed.
[[noreturn]] void throw_damaged();

// Throws an error that `accept=` with the name of `code` overrides; `code` must be acceptable. Do
// not call it if the import's options accept `code`.
[[noreturn]] void throw_overridable(NoteCode code, const std::string& reason);

// An error lists at most this many choices.
inline constexpr std::size_t kMostChoices = 1000;

// Throws an error with choices. The reason states their number and their difference; the list has
// the first kMostChoices.
[[noreturn]] void throw_choice(const std::string& reason, std::vector<Choice> choices);

}  // namespace isomesh::volume
