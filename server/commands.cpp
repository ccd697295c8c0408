#include "server/commands.h"

#include <filesystem>
#include <functional>
#include <iostream>
#include <string>
#include <string_view>

#include <CLI/CLI.hpp>

#include "base/command_line/completion.h"
#include "base/command_line/exit_status.h"
#include "base/command_line/manual.h"
#include "base/log.h"
#include "proto/json_tree.h"
#include "server/options.h"
#include "server/record_stores.h"
#include "server/store/files/data_folder.h"
#include "server/store/postgresql/connection.h"
#include "server/store/postgresql/move.h"
#include "server/store/sqlite/backup.h"
#include "server/token_command.h"
#include "server/wings.h"

namespace isomesh {
namespace {

const command_line::Manual& manual() {
  static const command_line::Manual text = {
      .number = 8,
      .version = ISOMESH_VERSION,
      .name = "turn medical volumes into surface meshes over HTTP",
      .sections = {
          {"Configuration",
           "Every option can also be set in the environment and in the file of --config. The file "
           "is TOML, with lines such as\n\n  max-queue = 500\n\nThe command line overrides the "
           "environment, which overrides the file. An unknown key is an error. `isomeshd config` "
           "prints such a file with every option in it. `isomeshd check` checks the options and "
           "prints those that would be used."},
          {"Signals",
           "SIGTERM and SIGINT drain: isomeshd accepts no new jobs, and running jobs have "
           "--drain-seconds to finish. Jobs that do not finish go back to the queue. SIGHUP "
           "reloads the tokens, the certificate and the keys of callbacks."},
          {"Exit status",
           "0 after it was asked to stop, 1 if it could not start or continue, 2 for wrong usage."},
          {"Files",
           "The systemd unit starts isomeshd with /etc/isomesh/isomeshd.toml. The data folder is "
           "then /var/lib/isomesh."},
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
  std::string target = {};
  std::uint64_t after = 0;  // for the audit trail
  bool verify = false;      // the audit trail
  std::function<void()> chosen = {};
  int status = exit_status::kDone;

  // Options of the program itself may follow a subcommand.
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
    CLI::App& tokens = *cli.add_subcommand("token", "Manage the file of --tokens");
    tokens.require_subcommand(1)->fallthrough()->configurable(false);
    CLI::App& added =
        add(tokens, "add", "Create a token and print it once", [this] { add_token(with_file()); });
    added.add_option("NAME", token.name, "User of the token; jobs and the log show this name")
        ->required();
    added
        .add_option(
            "--role", token.role,
            "user: own volumes and jobs; admin: everyone's, and /metrics; monitor: only /metrics")
        ->type_name("user|admin|monitor")
        ->capture_default_str();
    added
        .add_option("--into", token.file,
                    "Add the token's hash to this file. Default: the file of --tokens. Without "
                    "either, print the line to add")
        ->type_name("FILE");
    add(tokens, "list", "Print each token's name, role and the beginning of its hash",
        [this] { list_tokens(with_file()); });
    CLI::App& revoked = add(tokens, "revoke", "Remove the tokens of a user from the file",
                            [this] { revoke_tokens(with_file()); });
    revoked.add_option("NAME", token.name, "User of the tokens")->required();
    revoked
        .add_option("HASH", token.hash,
                    "Beginning of one token's hash. Without it, all tokens of the user are removed")
        ->check(CLI::Validator(
            [](const std::string& text) { return text.empty() ? "must not be empty" : ""; }, ""));
  }

  void check_is_whole() const {
    if (options.blobs.place.empty()) return;
    throw invalid_parameter(
        "blobs",
        "backup and restore need a data folder that has its files in it. docs/blobs.md says how to "
        "copy records and files that are stored separately");
  }

  void add_backup_commands() {
    CLI::App& backup = add(cli, "backup", "Copy the data folder; a daemon may be using it", [this] {
      refuse_database("use pg_dump to copy them (docs/cluster.md)");
      check_is_whole();
      tell("copied", store::back_up(options.data, folder));
    });
    backup.add_option("DIR", folder, "Folder to create; it must not exist")->required();
    CLI::App& restored =
        add(cli, "restore",
            "Restore the data folder from a backup; the folder must be missing or empty", [this] {
              refuse_database("use pg_restore to restore them (docs/cluster.md)");
              check_is_whole();
              tell("restored", store::restore(folder, options.data, wing_entry().tables));
            });
    restored.add_option("DIR", folder, "Folder that `isomeshd backup` created")->required();
  }

  void add_move_command() {
    CLI::App& move =
        add(cli, "move",
            "Move the records of the folder of --data to an empty database. No daemon may use the "
            "folder meanwhile. The files of volumes and meshes stay where they are",
            [this] {
              store::postgresql::check_url(target);
              const store::DataFolder folder_of_data(options.data, options.disk_reserve);
              const auto moved =
                  store::postgresql::move_records(folder_of_data, target, wing_entry().tables);
              std::cout << "moved " << moved.volumes << " volumes, " << moved.jobs << " jobs";
              for (const auto& [name, count] : moved.others) {
                std::cout << " and " << count << ' ' << name;
              }
              std::cout << std::endl;
            });
    move.add_option("--to", target, "The database, as postgresql://USER@HOST/NAME")->required();
  }

  // Can run beside a daemon.
  void add_audit_command() {
    CLI::App& audit = add(
        cli, "audit",
        "Print the audit trail of the folder of --data, or of --store, as one JSON object per line",
        [this] {
          if (verify) return verify_trail();
          with_trail(options, [this](store::SqlConnection& connection) {
            store::read_trail(connection, after,
                              [](std::string_view line) { std::cout << valid_utf8(line) << '\n'; });
          });
          std::cout.flush();
          if (!std::cout) {
            throw Error(ErrorCode::kInternal,
                        "the audit trail cannot be written to standard output");
          }
        });
    CLI::Option& from = *audit.add_option("--after", after, "Print only entries with a greater id")
                             ->capture_default_str();
    audit
        .add_flag("--verify", verify,
                  "Check the digests of all entries instead, and print the last; status 1 if an "
                  "entry was changed, removed or inserted")
        ->excludes(&from);
  }

  void verify_trail() {
    store::AuditCheck check;
    with_trail(options,
               [&](store::SqlConnection& connection) { check = store::verify_trail(connection); });
    if (check.misfit) {
      std::cerr << "isomeshd: entry " << *check.misfit
                << " of the audit trail does not fit: it or one before it was changed, removed or "
                   "inserted\n";
      status = exit_status::kRefused;
      return;
    }
    std::cout << check.entries << " entries fit";
    if (check.entries > 0) std::cout << "; the digest of " << check.last << " is " << check.digest;
    std::cout << std::endl;
  }

  // A copy without the database is incomplete.
  void refuse_database(const std::string& instead) const {
    if (options.store.empty()) return;
    throw Error(ErrorCode::kInvalidParameter,
                "the records are in the database of --store, not in the data folder: " + instead);
  }

  void tell(const char* what, const store::Copied& copied) {
    std::cout << what << ' ' << copied.blobs << " files, " << copied.bytes << " bytes" << std::endl;
    for (const std::string& lost : copied.damaged) {
      log_warning("{} is damaged: its bytes have changed", lost);
    }
    for (const std::string& lost : copied.missing) log_warning("{} is missing", lost);
    if (!copied.damaged.empty() || !copied.missing.empty()) status = exit_status::kRefused;
  }

  void add_description_commands() {
    add(cli, "config", "Print a file for --config with every option and its meaning",
        [this] { std::cout << as_config(cli, Remarks::kYes) << std::flush; });
    CLI::App& completion =
        add(cli, "completion", "Print a script that completes arguments in a shell", [this] {
          const std::string script = command_line::completion_script(cli.get_name(), shell);
          if (script.empty()) throw invalid_parameter("SHELL", "must be bash, zsh or fish");
          std::cout << script << std::flush;
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
