// The examples that help texts and the manual page show; private to this folder.
#pragma once

#include <string>
#include <string_view>

namespace isomesh::cli {

// The overview's examples, one per line, indented by two blanks.
std::string general_examples();

// The examples of one subcommand in the same form; empty if it has none.
std::string examples_of(std::string_view command);

}  // namespace isomesh::cli
