#include "client/mcp/command.h"

#include <filesystem>
#include <memory>

#include <CLI/CLI.hpp>

#include "client/cli/options.h"
#include "client/mcp/server.h"

namespace isomesh::cli {

Added mcp_commands() {
  const auto folder = std::make_shared<std::filesystem::path>(".");
  Added added;
  added.commands = {
      {.name = "mcp",
       .help = "Offer the server's work to a program with a language model, by the Model Context "
               "Protocol on standard input and output",
       .examples = R"(  isomesh mcp --folder ~/scans
)",
       .add_options =
           [folder](CLI::App& app, Options& /*options*/) {
             app.add_option("--folder", *folder,
                            "Files are read and written in this folder only (default: the working "
                            "folder)")
                 ->type_name("FOLDER")
                 ->check(CLI::ExistingDirectory);
           },
       .run =
           [folder](Client& client, const Options& options) {
             return serve_mcp(options, client, std::filesystem::canonical(*folder));
           }}};
  return added;
}

}  // namespace isomesh::cli
