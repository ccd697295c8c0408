#pragma once

#include <string_view>

namespace isomesh::orders {

// True if the text matches the pattern, in which * is any text and ? one character; ignores case.
bool matches(std::string_view pattern, std::string_view text);
// The same, but capital and small letters differ.
bool matches_case(std::string_view pattern, std::string_view text);

}  // namespace isomesh::orders
