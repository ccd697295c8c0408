// Help texts that fit a terminal of 80 columns.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace CLI {
class FormatterBase;
}

namespace isomesh::command_line {

// Breaks `text` between words so that no line is longer than 80 columns. Every line but the first
// is indented by `indent`; the first one begins at column `begin`. A longer word has a line of its
// own. Lines of `text` stay apart.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t begin = 0);

// To be given to CLI::App::formatter. Subcommands inherit it if they are added later.
std::shared_ptr<CLI::FormatterBase> wrapped_help();

}  // namespace isomesh::command_line
