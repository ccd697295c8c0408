// Commands that a component adds to those of this folder.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/cli/ids.h"
#include "client/isomesh/client.h"

namespace CLI {
class App;
}

namespace isomesh::cli {

struct Options;

struct AddedCommand {
  std::string name;
  std::string help;
  std::string examples;  // one per line, indented by two blanks
  // Adds its own options; those that it shares with other commands are members of `options`.
  std::function<void(CLI::App& app, Options& options)> add_options;
  // Returns the exit status. Throws Error as Client does.
  std::function<int(Client& client, const Options& options)> run;
};

// Ids that shells complete.
struct AddedIds {
  std::string operand;  // of commands, such as ORDER
  std::string kind;     // "orders"
  std::function<std::vector<Candidate>(Client& client)> newest;
};

struct Added {
  std::vector<AddedCommand> commands = {};
  std::vector<AddedIds> ids = {};
};

}  // namespace isomesh::cli
