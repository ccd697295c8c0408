// Help texts that fit a terminal of 80 columns.
#pragma once

#include <memory>
#include <string>
#include <string_view>

namespace CLI {
class FormatterBase;
}

namespace isomesh::command_line {

// Breaks `text` between words so that no line exceeds 80 columns. Every line but the first is
// indented by `indent`; the first begins at column `begin`. A word that is too long gets a line of
// its own. Line breaks of `text` are kept.
std::string wrapped(std::string_view text, std::size_t indent, std::size_t begin = 0);

// For CLI::App::formatter. Subcommands that are added later inherit it.
std::shared_ptr<CLI::FormatterBase> wrapped_help();

}  // namespace isomesh::command_line
