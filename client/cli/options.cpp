#include "client/cli/options.h"

#include <algorithm>
#include <array>
#include <map>
#include <sstream>
#include <string_view>
#include <utility>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "base/command_line/completion.h"
#include "base/command_line/help.h"
#include "base/command_line/manual.h"
#include "base/text.h"
#include "client/cli/batch.h"
#include "client/cli/exit_status.h"
#include "client/cli/ids.h"
#include "client/cli/option_groups.h"
#include "client/cli/option_values.h"
#include "proto/json.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

// The codec of a GLB that is saved, unless --glb-codec names another: programs on a desktop open
// it, and many of them decode nothing.
constexpr GlbCodec kSavedGlbCodec = GlbCodec::kNone;

constexpr const char* kDescription =
    "Turns medical volumes into surface meshes, on an isomesh server or on this computer alone.";

std::string exit_statuses() {
  std::string text;
  for (const auto& [status, meaning] : kExitStatuses) {
    text += (text.empty() ? "" : ", ") + std::to_string(status) + ' ' + meaning;
  }
  return text + ". Ctrl-C cancels the job and ends the command by SIGINT.";
}

command_line::Manual manual() {
  return {.number = 1,
          .version = ISOMESH_VERSION,
          .name = "turn medical volumes into surface meshes on an isomesh server",
          .sections = {{"Examples", general_examples()},
                       {"Exit status", exit_statuses()},
                       {"See also", "isomeshd(8)"}}};
}

void add_id(CLI::App& app, Options& options, const std::string& name) {
  const std::string kind = name == "JOB" ? "job" : "volume";
  app.add_option(name, options.id,
                 "Id of the " + kind + "; its beginning or end is enough if unique")
      ->required()
      ->type_name("ID");
}

void add_allow_empty(CLI::App& app, Options& options, const std::string& help) {
  app.add_flag("--allow-empty", options.allow_empty, help);
}

constexpr const char* kWriteEmpty =
    "Write the mesh and exit with status 0 if the surface is empty. Otherwise an empty surface "
    "writes nothing and exits with status 1";

bool is_utf8(const std::string& text) {
  try {
    static_cast<void>(nlohmann::json(text).dump());
    return true;
  } catch (const nlohmann::json::type_error&) {
    return false;
  }
}

class Parser {
 public:
  explicit Parser(const Added& added) : app_(kDescription, "isomesh"), added_(added) {
    app_.formatter(command_line::wrapped_help());
    app_.set_help_flag("-h,--help", "Print this help and exit");
    app_.set_version_flag("-V,--version", "isomesh " ISOMESH_VERSION, "Print the version and exit");
    app_.require_subcommand(1);
    app_.fallthrough();
    app_.footer("Examples:\n" + general_examples() + "\n" +
                command_line::wrapped("Exit status: " + exit_statuses(), 0) +
                "\n\n`isomesh COMMAND --help` shows the options and examples of a command.");
    app_.add_option("--server", options_.server,
                    "Address of the server: http://HOST:PORT, https://HOST:PORT or unix:PATH")
        ->envname("ISOMESH_SERVER")
        ->type_name("URL")
        ->capture_default_str();
    app_.add_option("--token", options_.token, "Bearer token, if the server requires one")
        ->envname("ISOMESH_TOKEN")
        ->type_name("TOKEN");
    app_.add_option("--ca", options_.authorities,
                    "File of certificate authorities (PEM) to trust instead of the system's")
        ->envname("ISOMESH_CA")
        ->type_name("FILE")
        ->check(CLI::ExistingFile);
    add_number<int>(
        app_, "--retry-seconds",
        "Seconds that a request waits if the server is busy; 0 does not wait (default: 600)",
        [&](int seconds) {
          if (seconds < 0) refuse("--retry-seconds", kSecondsRange);
          options_.retry_seconds = seconds;
        },
        kSecondsRange);
    app_.add_flag("--json", options_.json, "Print JSON to standard output");
    app_.add_flag("-q,--quiet", options_.quiet, "Print only errors");

    add_mesh(command(Command::kMesh, "mesh", "Upload volumes, mesh them and download the meshes"),
             Inputs::kFilesAndVolumes);
    add_local();

    CLI::App& upload = command(Command::kUpload, "upload", "Upload a volume and print its id");
    add_file(upload, options_);
    add_raw(upload, options_);

    CLI::App& submit = command(Command::kSubmit, "submit", "Start a job and print its id");
    add_id(submit, options_, "VOLUME");
    add_parameters(submit, options_.parameters, Formats::kAsOption);
    submit
        .add_option("--key", options_.key,
                    "Idempotency key: the same key returns the same job (default: a new key)")
        ->type_name("KEY");

    CLI::App& estimate =
        command(Command::kEstimate, "estimate", "Estimate the size, memory and time of a job");
    add_id(estimate, options_, "VOLUME");
    add_parameters(estimate, options_.parameters, Formats::kAsOption, Carrier::kQuery);

    add_id(command(Command::kStatus, "status", "Show a job"), options_, "JOB");
    CLI::App& wait = command(Command::kWait, "wait", "Wait until a job ends, then show it");
    add_id(wait, options_, "JOB");
    add_allow_empty(wait, options_, "Exit with status 0 instead of 1 if the surface is empty");

    CLI::App& fetch = command(Command::kFetch, "fetch", "Download the mesh of a finished job");
    add_id(fetch, options_, "JOB");
    add_outputs(fetch, outputs_);
    add_number<std::int64_t>(fetch, "--label",
                             "Download the surface of this label alone, from a job with --labels",
                             [&](std::int64_t label) { options_.label = label; });
    add_allow_empty(fetch, options_, kWriteEmpty);

    CLI::App& report = command(Command::kReport, "report",
                               "Print what a finished job made, of what and how, as JSON to keep");
    add_id(report, options_, "JOB");
    report.add_option("-o,--output", options_.report, "File to write instead of standard output")
        ->type_name("FILE");

    add_id(command(Command::kCancel, "cancel", "Cancel a job"), options_, "JOB");

    CLI::App& rename = command(Command::kRename, "rename", "Rename a volume");
    add_id(rename, options_, "VOLUME");
    rename.add_option("NAME", options_.name, "The new name; \"\" removes the name")->required();

    CLI::App& reorient = command(Command::kReorient, "reorient",
                                 "Store a flipped or turned copy of a volume, and print its id");
    add_id(reorient, options_, "VOLUME");
    reorient
        .add_option("--axes", options_.axes,
                    "The axes whose directions x, y and z get. -x,y,z flips the volume along x; "
                    "y,-x,z turns it by 90 degrees about z")
        ->type_name("AXES")
        ->required();

    CLI::App& erase =
        command(Command::kErase, "erase", "Delete volumes, or jobs and their meshes, for good");
    erase
        .add_option("VOLUME", options_.ids,
                    "Ids of the volumes; unique beginnings or ends are enough")
        ->type_name("ID")
        ->required();
    CLI::Option* const with_jobs =
        erase.add_flag("--with-jobs", options_.with_jobs,
                       "Also delete the ended jobs on these volumes, with their meshes");
    erase.add_flag("--jobs", options_.are_jobs, "The ids are of ended jobs instead")
        ->excludes(with_jobs);

    CLI::App& list = command(Command::kList, "list", "List jobs, or volumes");
    add_name<JobState>(list, "--state", "Only jobs in this state",
                       [&](JobState state) { options_.filter.state = state; });
    list.add_option("--volume", options_.filter.volume, "Only jobs on this volume")
        ->type_name("ID");
    list.add_option("--since", options_.filter.since,
                    "Only jobs submitted since this day, or time in UTC such as "
                    "2026-11-20T07:30:00Z")
        ->type_name("DATE");
    list.add_option("--until", options_.filter.until, "Only jobs submitted before it")
        ->type_name("DATE");
    list.add_option("--cursor", options_.cursor,
                    "Cursor of the page to show; the previous page prints it")
        ->type_name("CURSOR");
    list.add_flag("--volumes", options_.volumes, "List volumes instead");

    add_id(command(Command::kInfo, "info", "Show a volume"), options_, "VOLUME");

    CLI::App& labels =
        command(Command::kLabels, "labels", "List the labels of a volume that is a label map");
    add_id(labels, options_, "VOLUME");
    add_number<std::int64_t>(labels, "--background",
                             "Value of samples without a label (default: 0)",
                             [&](std::int64_t value) { options_.background = value; });
    CLI::App& walls =
        command(Command::kWalls, "walls", "List the areas where the labels of a job touch");
    add_id(walls, options_, "JOB");
    walls.add_flag("--edge-contacts", options_.edge_contacts,
                   "List also pairs that meet at edges of voxels only");
    add_commands();
    add_descriptions();
  }

  void add_commands() {
    for (const AddedCommand& each : added_.commands) {
      CLI::App& app = command(Command::kAdded, each.name, each.help);
      app.footer("Examples:\n" + each.examples);
      app.callback([this, &each] {
        options_.command = Command::kAdded;
        options_.added = &each;
      });
      each.add_options(app, options_);
    }
  }

  Options parse(int argc, const char* const* argv) {
    if (argc > 1 && std::string_view(argv[1]) == "complete")
      return completed({argv + 2, argv + argc});
    check_names(app_, argc, argv);
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      std::ostringstream out;
      std::ostringstream err;
      if (app_.exit(error, out, err) == 0) throw EarlyExit(0, out.str());
      wrong_usage(in_words(error) + "\n" + help_of_command());
    }
    describe_itself();
    check_text();
    options_.outputs = outputs_from(outputs_);
    // A dry run may have formats without files.
    if (options_.outputs.empty() && !outputs_.formats.empty()) {
      options_.parameters.formats = outputs_.formats;
    }
    if (options_.command == Command::kMesh) choose_glb_codec();
    if (options_.command == Command::kMesh) check_mesh();
    if (options_.command == Command::kFetch && options_.outputs.empty()) {
      wrong_usage("-o is required");
    }
    if (options_.command == Command::kFetch) check_fetch();
    check_parameters();
    return std::move(options_);
  }

 private:
  // The library's "--iso excludes --labels", "--passes: 1 required N missing" and "--passes: At
  // Most 1 required but received 2" in plain words.
  static std::string in_words(const CLI::ParseError& error) {
    constexpr std::string_view kExcludes = " excludes ";
    std::string text = error.what();
    if (error.get_name() == "ExcludesError") {
      const std::size_t at = text.find(kExcludes);
      if (at != std::string::npos) text.replace(at, kExcludes.size(), " cannot be used with ");
    } else if (error.get_name() == "ArgumentMismatch") {
      const std::size_t at = text.find(": 1 required ");
      if (at != std::string::npos) text = text.substr(0, at) + " needs a value";
      const std::size_t most = text.find(": At Most 1 required ");
      if (most != std::string::npos) text = text.substr(0, most) + " can only be given once";
    }
    return text;
  }

  CLI::App& command(Command value, const std::string& name, const std::string& help) {
    CLI::App* app = app_.add_subcommand(name, help);
    app->footer(footer_of(name));
    app->callback([this, value] { options_.command = value; });
    return *app;
  }

  void add_descriptions() {
    completion_ = app_.add_subcommand("completion", "Print the completion script of a shell");
    completion_->add_option("SHELL", shell_, "The shell")->required()->type_name("bash|zsh|fish");
    completion_->footer(footer_of("completion"));
    manual_ = app_.add_subcommand("manual", "Print the manual page");
    manual_->group("");
    // For completions.
    CLI::App& ids = command(Command::kIds, "ids", "Print ids, one a line");
    ids.add_option("KIND", options_.kind, "What to list")
        ->required()
        ->check([this](const std::string& kind) {
          for (const AddedIds& each : added_.ids) {
            if (each.kind == kind) options_.added_ids = &each;
          }
          const bool is_known =
              kind == "volumes" || kind == "jobs" || options_.added_ids != nullptr;
          return is_known ? std::string() : "there is no kind " + kind;
        });
    ids.group("");
  }

  void describe_itself() const {
    if (manual_->parsed()) throw EarlyExit(0, command_line::manual_page(app_, manual()));
    if (!completion_->parsed()) return;
    const std::string script = command_line::completion_script(app_.get_name(), shell_);
    if (script.empty()) wrong_usage("SHELL must be bash, zsh or fish");
    throw EarlyExit(0, script);
  }

  // Only the server knows ids.
  Options completed(const std::vector<std::string>& words) {
    const command_line::Candidates found = command_line::candidates(app_, words);
    std::map<std::string, std::string> kinds = {{"VOLUME", "volumes"}, {"JOB", "jobs"}};
    for (const AddedIds& each : added_.ids) kinds[each.operand] = each.kind;
    const auto kind = kinds.find(found.operand);
    if (kind == kinds.end()) throw EarlyExit(0, found.lines);
    const std::array arguments = {"isomesh", "ids", kind->second.c_str()};
    return parse(static_cast<int>(arguments.size()), arguments.data());
  }

  void add_mesh(CLI::App& app, Inputs inputs) {
    add_file(app, options_, inputs);
    add_outputs(app, outputs_);
    add_number<int>(
        app, "--jobs", "Number of FILEs to mesh at the same time (default: 1)",
        [&](int jobs) {
          if (jobs < 1 || jobs > kMostJobs) refuse("--jobs", kJobsRange);
          options_.jobs = jobs;
        },
        kJobsRange);
    app.add_flag("--dry-run", options_.dry_run,
                 "Upload the volume, estimate the job, and delete the volume again if it is new");
    app.add_flag("--skip-existing", options_.skip_existing,
                 "Leave out each FILE whose meshes are all newer than it, such as those of a run "
                 "that was interrupted. Other options are not compared");
    add_allow_empty(app, options_, kWriteEmpty);
    // Help tells this default; choose_glb_codec applies it.
    const GlbCodec usual = std::exchange(options_.parameters.glb_codec, kSavedGlbCodec);
    add_parameters(app, options_.parameters, Formats::kByFiles);
    options_.parameters.glb_codec = usual;
    add_raw(app, options_);
  }

  void add_local() {
    CLI::App& local =
        command(Command::kMesh, "local", "Mesh without a server; takes the same options as mesh");
    local.callback([this] {
      options_.command = Command::kMesh;
      options_.is_local = true;
    });
    add_mesh(local, Inputs::kFiles);
    local
        .add_option("--daemon", options_.daemon,
                    "The program isomeshd, if it is neither beside isomesh nor in PATH")
        ->envname("ISOMESHD")
        ->type_name("FILE");
  }

  // JSON would silently hold another text. The names of files and of an archive's members may be in
  // any encoding.
  void check_text() const {
    for (const CLI::Option* option : app_.get_subcommands().front()->get_options()) {
      const std::string type = option->get_type_name();
      if (type == "FILE" || type == "OUT" || option->check_name("--member")) continue;
      if (!std::ranges::all_of(option->results(), is_utf8)) {
        wrong_usage(option->get_name() + ": is not UTF-8; this is the encoding of all texts");
      }
    }
  }

  // A job without a GLB keeps the usual codec, so that it can share its mesh with those of other
  // clients. Draco's options, unless they are for a drc file, ask for Draco.
  void choose_glb_codec() {
    const auto formats =
        options_.outputs.empty() ? options_.parameters.formats : formats_of(options_.outputs);
    const auto has = [&](MeshFormat format) {
      return std::ranges::find(formats, format) != formats.end();
    };
    const auto is_given = [&](const char* name) {
      return app_.get_subcommands().front()->get_option(name)->count() > 0;
    };
    const bool asks_for_draco =
        !has(MeshFormat::kDrc) && (is_given("--position-bits") || is_given("--speed"));
    if (has(MeshFormat::kGlb) && !is_given("--glb-codec") && !asks_for_draco) {
      options_.parameters.glb_codec = kSavedGlbCodec;
    }
  }

  void check_mesh() const {
    if (options_.outputs.empty() && !options_.dry_run) wrong_usage("-o is required");
    const bool is_piped = std::ranges::any_of(options_.outputs, &Output::is_stdout);
    if (is_piped && (options_.json || options_.outputs.size() > 1)) {
      wrong_usage("-o: standard output takes one mesh and nothing else");
    }
    if (options_.dry_run && !options_.parameters.label_values.empty()) {
      wrong_usage("--dry-run: estimates do not support --label-values");
    }
    check_outputs();
    check_stored();
  }

  void check_fetch() const {
    for (const Output& output : options_.outputs) {
      if (has_folder(output.path)) wrong_usage("-o: {folder} needs a FILE; a job is in no folder");
    }
  }

  // Rejects in advance what the server would reject.
  void check_parameters() const {
    const bool is_job = options_.command == Command::kMesh ||
                        options_.command == Command::kSubmit ||
                        options_.command == Command::kEstimate;
    if (!is_job) return;
    JobParameters parameters = options_.parameters;
    parameters.volume = "any";
    if (!options_.outputs.empty()) parameters.formats = formats_of(options_.outputs);
    const std::string url = parameters.callback ? lower(parameters.callback->url) : "http://";
    if (!url.starts_with("http://") && !url.starts_with("https://")) {
      wrong_usage("--callback: must begin with http:// or https://");
    }
    try {
      parse_job_parameters(to_json(parameters));
    } catch (const Error& error) {
      wrong_usage(in_options(error));
    }
  }

  void check_outputs() const {
    const auto& labels = options_.parameters.labels;
    for (const Output& output : options_.outputs) {
      const std::string file = output.path.string();
      if (!labels && output.format == MeshFormat::kZip) {
        wrong_usage("-o: " + file + " needs --labels: a .zip holds one file per label");
      }
      const bool holds_one = !holds_all_labels(output.format) && output.format != MeshFormat::kZip;
      if (labels && holds_one && labels->values.size() != 1) {
        wrong_usage(
            "-o: " + file +
            " can hold only one label. Use .glb, .3mf, .usdz, .ply, .obj, .vtk or .vtp for all "
            "labels in one file, or .zip for one file per label");
      }
    }
  }

  // Stored volumes have no file that options could describe.
  void check_stored() const {
    const bool has_stored = std::ranges::any_of(options_.files, is_stored_volume);
    const auto given = app_.get_subcommands().front()->get_options([](const CLI::Option* option) {
      return option->count() > 0 &&
             (option->get_group() == kUploadGroup || option->get_group() == kRawGroup);
    });
    if (has_stored && !given.empty()) {
      wrong_usage(given.front()->get_name() + " applies to files, not to stored volumes");
    }
    if (has_stored && options_.files.size() > 1 && !is_by_name(options_.outputs)) {
      wrong_usage("-o: several volumes need a folder, or {name} in the file's name");
    }
  }

  static std::string footer_of(const std::string& name) {
    const std::string examples = examples_of(name);
    return examples.empty() ? "" : "Examples:\n" + examples;
  }

  std::string help_of_command() const {
    const auto parsed = app_.get_subcommands();
    return "`isomesh" + (parsed.empty() ? "" : ' ' + parsed.front()->get_name()) +
           " --help` explains the options";
  }

  static constexpr const char* kSecondsRange = "must be a whole number from 0 up";
  static constexpr int kMostJobs = 64;
  static constexpr const char* kJobsRange = "must be a whole number from 1 to 64";

  Options options_;
  GivenOutputs outputs_;
  CLI::App app_;
  const Added& added_;
  CLI::App* completion_ = nullptr;
  CLI::App* manual_ = nullptr;
  std::string shell_;
};

}  // namespace

bool is_pipe(const std::filesystem::path& path) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  return std::filesystem::is_fifo(status) || std::filesystem::is_character_file(status);
}

void wrong_usage(const std::string& message) {
  throw EarlyExit(kWrongUsage, "isomesh: " + printable_lines(message) + '\n');
}

Options parse_options(int argc, const char* const* argv, const Added& added) {
  return Parser(added).parse(argc, argv);
}

}  // namespace isomesh::cli
