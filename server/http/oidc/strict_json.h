// JSON from strangers who sign it: a reader that every other reader agrees with.
#pragma once

#include <string_view>

#include "proto/json_tree.h"

namespace isomesh::oidc {

// Throws Error kInvalidParameter unless the text is one JSON object of at most 16 levels, in which
// no object has two members of one name: readers differ in which of the two they believe.
JsonTree strict_object(std::string_view text);

// The text of a member; empty if there is no such member or it is no text.
std::string text_of(const Json& object, std::string_view name);

}  // namespace isomesh::oidc
