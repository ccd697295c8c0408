#include "server/commands.h"

#include <filesystem>
#include <functional>
#include <iostream>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>
#include <spdlog/spdlog.h>

#include "base/command_line/completion.h"
#include "base/command_line/manual.h"
#include "server/options.h"
#include "server/records.h"
#include "server/store/backup.h"
#include "server/store/files/data_folder.h"
#include "server/store/postgresql/connection.h"
#include "server/store/postgresql/move.h"
#include "server/token_command.h"

namespace isomesh {
namespace {

const command_line::Manual& manual() {
  static const command_line::Manual text = {
      .number = 8,
      .version = ISOMESH_VERSION,
      .name = "turn medical volumes into surface meshes over HTTP",
      .sections = {
          {"Configuration",
           "Every option also comes from the environment and from the file of --config, which is "
           "TOML: "
           "lines such as\n\n  max-queue = 500\n\nWhat is nearer to the command line wins. A key "
           "that is no "
           "option is refused. `isomeshd config` prints such a file with every option in it, and "
           "`isomeshd check` what would be used."},
          {"Signals",
           "SIGTERM and SIGINT drain: no job is accepted any more, running ones have "
           "--drain-seconds to "
           "finish and are put back otherwise. SIGHUP reads tokens, certificate and secrets of "
           "callbacks "
           "again."},
          {"Exit status",
           "0 when it was asked to end, 1 when it could not start or go on, 2 for wrong usage."},
          {"Files",
           "/etc/isomesh/isomeshd.toml is what the systemd unit starts it with. /var/lib/isomesh "
           "is the data "
           "folder there."},
          {"See also", "isomesh(1)"}}};
  return text;
}

}  // namespace

struct Commands::State {
  CLI::App& cli;
  const Options& options;
  TokenRequest token = {};
  std::string shell = {};
  std::filesystem::path folder = {};
  std::string target = {};  // of move
  std::uint64_t after = 0;  // of the audit trail
  std::function<void()> chosen = {};
  int status = 0;

  // Later options of the program itself may follow a subcommand.
  CLI::App& add(CLI::App& parent, const std::string& name, const std::string& help,
                const std::function<void()>& act) {
    CLI::App& command = *parent.add_subcommand(name, help);
    command.fallthrough()->configurable(false)->callback([this, act] { chosen = act; });
    return command;
  }

  TokenRequest with_file() const {
    TokenRequest request = token;
    if (request.file.empty()) request.file = options.tokens;
    return request;
  }

  void add_token_commands() {
    CLI::App& tokens = *cli.add_subcommand("token", "Handle the file of --tokens");
    tokens.require_subcommand(1)->fallthrough()->configurable(false);
    CLI::App& added =
        add(tokens, "add", "Make a token and print it, once", [this] { add_token(with_file()); });
    added.add_option("NAME", token.name, "Whose it is, as jobs and the log name it")->required();
    added
        .add_option("--role", token.role,
                    "user: its own volumes and jobs; admin: everybody's, and /metrics; monitor: "
                    "/metrics alone")
        ->type_name("user|admin|monitor")
        ->capture_default_str();
    added
        .add_option("--into", token.file,
                    "Add the token's hash to this file; that of --tokens otherwise, and without "
                    "either its line is printed")
        ->type_name("FILE");
    add(tokens, "list", "Print name, role and the beginning of the hash of each token",
        [this] { list_tokens(with_file()); });
    CLI::App& revoked = add(tokens, "revoke", "Take tokens of a name out of the file",
                            [this] { revoke_tokens(with_file()); });
    revoked.add_option("NAME", token.name, "Whose")->required();
    revoked
        .add_option("HASH", token.hash,
                    "The beginning of one token's hash; all of the name without it")
        ->check(CLI::Validator(
            [](const std::string& text) { return text.empty() ? "it must not be empty" : ""; },
            ""));
  }

  void check_is_whole() const {
    if (options.blobs.place.empty()) return;
    throw invalid_parameter("blobs",
                            "a backup is of a data folder that has its files in it; docs/blobs.md "
                            "says how records and files that are apart are copied");
  }

  void add_backup_commands() {
    CLI::App& backup =
        add(cli, "backup", "Copy the data folder, also while a daemon uses it", [this] {
          refuse_database("pg_dump copies the records (docs/cluster.md)");
          check_is_whole();
          tell("copied", store::back_up(options.data, folder));
        });
    backup.add_option("DIR", folder, "The folder to make, which must not be there")->required();
    CLI::App& restored = add(
        cli, "restore", "Make the data folder from a backup; it must be missing or empty", [this] {
          refuse_database("pg_restore puts the records back (docs/cluster.md)");
          check_is_whole();
          tell("put back", store::restore(folder, options.data));
        });
    restored.add_option("DIR", folder, "The folder that `isomeshd backup` made")->required();
  }

  void add_move_command() {
    CLI::App& move = add(
        cli, "move",
        "Bring the records of the folder of --data, which no daemon may use meanwhile, to an empty "
        "database; its files of volumes and meshes stay where they are",
        [this] {
          store::postgresql::check_url(target);
          const store::DataFolder folder_of_data(options.data, options.disk_reserve);
          const auto moved = store::postgresql::move_records(folder_of_data, target);
          std::cout << "moved " << moved.volumes << " volumes, " << moved.jobs << " jobs and "
                    << moved.orders << " orders" << std::endl;
        });
    move.add_option("--to", target, "postgresql://... of the database")->required();
  }

  // May be asked for while a daemon runs.
  void add_audit_command() {
    CLI::App& audit =
        add(cli, "audit",
            "Print the audit trail of the folder of --data, or of --store, one JSON object a line",
            [this] {
              read_audit_trail(options, after,
                               [](std::string_view line) { std::cout << line << '\n'; });
              std::cout.flush();
              if (!std::cout) {
                throw Error(ErrorCode::kInternal, "standard output takes no more of the trail");
              }
            });
    audit.add_option("--after", after, "Only what has a greater id")->capture_default_str();
  }

  // Half a copy is none.
  void refuse_database(const std::string& instead) const {
    if (options.store.empty()) return;
    throw Error(
        ErrorCode::kInvalidParameter,
        "the records are in the database of --store and not in the data folder: " + instead);
  }

  void tell(const char* what, const store::Copied& copied) {
    std::cout << what << ' ' << copied.blobs << " files of volumes and meshes, " << copied.bytes
              << " bytes" << std::endl;
    for (const std::string& lost : copied.damaged) {
      spdlog::warn("damaged: {}; its bytes are not what they were", lost);
    }
    for (const std::string& lost : copied.missing) spdlog::warn("missing: {}", lost);
    if (!copied.damaged.empty() || !copied.missing.empty()) status = 1;
  }

  void add_description_commands() {
    add(cli, "config", "Print a file for --config with every option and what it means",
        [this] { std::cout << as_config(cli, Remarks::kYes) << std::flush; });
    CLI::App& completion =
        add(cli, "completion", "Print what a shell completes arguments with", [this] {
          const auto shell_asked = command_line::shell_from(shell);
          if (!shell_asked) throw invalid_parameter("SHELL", "must be bash, zsh or fish");
          std::cout << command_line::completion(cli, *shell_asked) << std::flush;
        });
    completion.add_option("SHELL", shell, "bash, zsh or fish")->required();
    add(cli, "manual", "Print the manual page", [this] {
      std::cout << command_line::manual_page(cli, manual()) << std::flush;
    }).group("");
  }
};

Commands::Commands(CLI::App& cli, const Options& options)
    : state_(std::make_unique<State>(State{cli, options})) {
  state_->add_token_commands();
  state_->add_backup_commands();
  state_->add_move_command();
  state_->add_audit_command();
  state_->add_description_commands();
}

Commands::~Commands() = default;

bool Commands::asked() const { return state_->chosen != nullptr; }

int Commands::run() {
  state_->chosen();
  return state_->status;
}

}  // namespace isomesh
