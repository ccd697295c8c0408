// Refusals of volumes, all as Error kUnusableVolume with a reason that is a sentence.
#pragma once

#include <string>
#include <vector>

#include "base/error.h"
#include "proto/notes.h"

namespace isomesh::volume {

[[noreturn]] void throw_unusable(const std::string& reason);

// Of a stored volume whose bytes are not those any more that were stored.
[[noreturn]] void throw_damaged();

// Throws a refusal that a person may overrule with `accept=` and the name of `code`, which is an
// acceptable one. Not to be called where the import's options accept it.
[[noreturn]] void throw_overridable(NoteCode code, const std::string& reason);

// Throws a refusal that lists what to choose from. The reason is to say how many there are and how
// they differ; the list is cut after some hundreds.
[[noreturn]] void throw_choice(const std::string& reason, std::vector<Choice> choices);

}  // namespace isomesh::volume
