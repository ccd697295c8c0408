#include "client/cli/options.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>
#include <string_view>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/command_line/completion.h"
#include "base/command_line/manual.h"
#include "base/text.h"
#include "client/cli/option_values.h"
#include "client/cli/orders.h"
#include "client/cli/output_options.h"
#include "client/cli/parameter_options.h"
#include "proto/json.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

constexpr const char* kDescription = "Turns volumes into surface meshes on an isomesh server.";

constexpr const char* kExamples = R"(
  isomesh mesh head.nii.gz --iso 60 -o head.drc
  isomesh mesh ct-series/ --iso bone --passes 10 -o bone.glb -o bone.stl
  isomesh mesh scans/*.nii.gz --iso otsu -o meshes/ --format glb --jobs 4
  zcat head.nii.gz | isomesh local - --iso 60 -o - --format stl >head.stl
  isomesh mesh ct.raw --dims 512,512,300 --type int16 --spacing 0.7,0.7,1 --iso 300 -o ct.stl
  isomesh mesh organs.seg.nrrd --labels all -o body.glb -o organs.zip
  isomesh submit $(isomesh upload head.nii.gz) --iso 60 --format drc,stl
  isomesh --server https://meshes.example.org --json list
)";

constexpr const char* kExitStatus =
    "0 done, 1 the job failed or was refused, 2 wrong usage, 3 the server could not be reached.";

command_line::Manual manual() {
  return {
      .number = 1,
      .version = ISOMESH_VERSION,
      .name = "turn medical volumes into surface meshes on an isomesh server",
      .sections = {
          {"Examples", kExamples + 1}, {"Exit status", kExitStatus}, {"See also", "isomeshd(8)"}}};
}

void add_file(CLI::App& app, Options& options) {
  app.add_option_function<std::vector<std::string>>(
         "FILE",
         [&](const std::vector<std::string>& paths) {
           for (const std::string& path : paths) {
             std::error_code error;
             if (path != "-" && !std::filesystem::exists(path, error)) {
               refuse("FILE", path + " is not there");
             }
             if (path == "-" && std::ranges::count(paths, "-") > 1) {
               refuse("FILE", "standard input, -, can be read once");
             }
             options.files.emplace_back(path);
           }
         },
         "NIfTI, NRRD, MetaImage, VTI, DICOM, a folder or archive of one, or raw samples with "
         "--dims and --type; several files that belong together, such as .hdr and .img; - for "
         "standard input")
      ->type_name("FILE")
      ->required();
  add(app, "--series", "UID", "The DICOM series to take, where there are several",
      [&](const std::string& text) { options.upload.series = text; })
      ->group("Upload");
  add(app, "--member", "NAME", "The archive's member to take, where it holds several volumes",
      [&](const std::string& text) { options.upload.member = text; })
      ->group("Upload");
  add_number<std::uint32_t>(app, "--volume", "The volume to take of a file of several, from 0 on",
                            [&](std::uint32_t number) { options.upload.volume = number; })
      ->group("Upload");
  add(app, "--accept", "CODE,..", "Take it in spite of what the server would refuse it for",
      [&](const std::string& text) {
        for (const std::string_view code : split(text, ','))
          options.upload.accept.emplace_back(code);
      })
      ->group("Upload");
  add_name<NiftiForm>(app, "--nifti-form", "Which form of a NIfTI header to go by: sform or qform",
                      [&](NiftiForm form) { options.upload.nifti_form = form; })
      ->group("Upload");
  add(app, "--name", "TEXT", "What to call the volume (default: as the series or the file)",
      [&](const std::string& text) { options.upload.name = text; })
      ->group("Upload");
  app.add_flag("--digest", options.upload.digest, "Have the server check the file's SHA-256")
      ->group("Upload");
}

void add_raw(CLI::App& app, Options& options) {
  const auto raw = [&options]() -> RawDescription& {
    auto& described = options.upload.raw;
    return described ? *described : described.emplace();
  };
  auto* dims = add(app, "--dims", "X,Y,Z", "Samples along x, y and z; x runs fastest",
                   [raw](const std::string& text) {
                     raw().dims = numbers_from<std::uint32_t, 3>("--dims", text);
                     if (std::ranges::count(raw().dims, 0U) > 0)
                       refuse("--dims", "must be 1 or more");
                   });
  auto* type = add_name<SampleType>(app, "--type", "Such as uint8, int16, float32",
                                    [raw](SampleType value) { raw().type = value; });
  dims->needs(type);
  type->needs(dims);
  std::vector<CLI::Option*> others = {
      add(app, "--spacing", "X,Y,Z", "Millimetres between samples",
          [raw](const std::string& text) {
            raw().geometry.spacing = numbers_from<double, 3>("--spacing", text);
            const auto is_length = [](double length) {
              return length > 0 && std::isfinite(length);
            };
            if (!std::ranges::all_of(raw().geometry.spacing, is_length)) {
              refuse("--spacing", "must be greater than 0");
            }
          }),
      add(app, "--origin", "X,Y,Z", "Where the first sample lies, in millimetres (LPS)",
          [raw](const std::string& text) {
            raw().geometry.origin = numbers_from<double, 3>("--origin", text);
          }),
      add(app, "--direction", "A,..,I", "Nine numbers, row by row; columns are the axes",
          [raw](const std::string& text) {
            raw().geometry.direction = numbers_from<double, 9>("--direction", text);
          }),
      add(app, "--byte-order", "ORDER", "little (the default) or big",
          [raw](const std::string& text) {
            if (text != "little" && text != "big") refuse("--byte-order", "must be little or big");
            raw().big_endian = text == "big";
          })};
  for (CLI::Option* other : others) other->needs(dims)->group("Raw samples");
  dims->group("Raw samples");
  type->group("Raw samples");
}

void add_id(CLI::App& app, Options& options, const std::string& name) {
  app.add_option(name, options.id, "Its id")->required();
}

void add_allow_empty(CLI::App& app, Options& options) {
  app.add_flag("--allow-empty", options.allow_empty,
               "Exit with 0 also where the surface is empty, which else is 1");
}

class Parser {
 public:
  Parser() : app_(kDescription, "isomesh") {
    app_.set_version_flag("--version", "isomesh " ISOMESH_VERSION);
    app_.require_subcommand(1);
    app_.fallthrough();
    app_.footer(std::string("\nExamples:") + kExamples + "\nExit status: " + kExitStatus);
    app_.add_option("--server", options_.server, "http://HOST:PORT, https://HOST:PORT or unix:PATH")
        ->envname("ISOMESH_SERVER")
        ->type_name("URL")
        ->capture_default_str();
    app_.add_option("--token", options_.token, "The bearer token, where the server wants one")
        ->envname("ISOMESH_TOKEN")
        ->type_name("TOKEN");
    app_.add_option("--ca", options_.authorities,
                    "File of the certificate authorities to trust, where the system's do not do")
        ->envname("ISOMESH_CA")
        ->type_name("FILE")
        ->check(CLI::ExistingFile);
    app_.add_flag("--json", options_.json, "JSON on standard output");
    app_.add_flag("-q,--quiet", options_.quiet, "Say nothing but what went wrong");

    add_mesh(command(Command::kMesh, "mesh", "Upload volumes, mesh them, download the meshes"));
    add_local();

    CLI::App& upload = command(Command::kUpload, "upload", "Upload a volume and print its id");
    add_file(upload, options_);
    add_raw(upload, options_);

    CLI::App& submit = command(Command::kSubmit, "submit", "Start a job and print its id");
    add_id(submit, options_, "VOLUME");
    add_parameters(submit, options_.parameters, options_.preset, Formats::kAsOption);
    submit
        .add_option("--key", options_.key,
                    "Idempotency key: the same one gives the same job again (default: a new one)")
        ->type_name("KEY");

    CLI::App& estimate =
        command(Command::kEstimate, "estimate", "Say what a job would make and take");
    add_id(estimate, options_, "VOLUME");
    add_parameters(estimate, options_.parameters, options_.preset, Formats::kAsOption,
                   Carrier::kQuery);

    add_id(command(Command::kStatus, "status", "Show a job"), options_, "JOB");
    CLI::App& wait = command(Command::kWait, "wait", "Wait for a job and show it");
    add_id(wait, options_, "JOB");
    add_allow_empty(wait, options_);

    CLI::App& fetch = command(Command::kFetch, "fetch", "Download the mesh of a finished job");
    add_id(fetch, options_, "JOB");
    add_outputs(fetch, outputs_);
    add_number<std::int64_t>(fetch, "--label", "Of a job by labels: this label's own surface",
                             [&](std::int64_t label) { options_.label = label; });

    add_id(command(Command::kCancel, "cancel", "Cancel a job"), options_, "JOB");

    CLI::App& rename = command(Command::kRename, "rename", "Give a volume another name");
    add_id(rename, options_, "VOLUME");
    rename.add_option("NAME", options_.name, "What it is called; empty for no name")->required();

    command(Command::kErase, "erase", "Erase volumes and their samples")
        .add_option("VOLUME", options_.ids, "Their ids")
        ->required();

    CLI::App& list = command(Command::kList, "list", "List jobs, or volumes");
    add_name<JobState>(list, "--state", "Only jobs in this state",
                       [&](JobState state) { options_.state = state; });
    list.add_option("--cursor", options_.cursor, "The page to show, as the one before names it")
        ->type_name("CURSOR");
    list.add_flag("--volumes", options_.volumes, "List volumes instead");

    add_id(command(Command::kInfo, "info", "Show a volume"), options_, "VOLUME");

    CLI::App& labels =
        command(Command::kLabels, "labels", "List the labels of a volume that is a label map");
    add_id(labels, options_, "VOLUME");
    add_number<std::int64_t>(labels, "--background",
                             "The value that belongs to no label (default: 0)",
                             [&](std::int64_t value) { options_.background = value; });
    add_order_commands();
    add_descriptions();
  }

  // What is about a PACS.
  void add_order_commands() {
    add_order_options(command(Command::kOrder, "order",
                              "Order a mesh of a series in a PACS, back into a PACS, and wait"),
                      options_);
    add_orders_options(command(Command::kOrders, "orders", "List orders, or act on one"), options_);
    command(Command::kPacs, "pacs", "List the PACS that the server knows, and how they are");
  }

  Options parse(int argc, const char* const* argv) {
    check_names(argc, argv);
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      std::ostringstream out;
      std::ostringstream err;
      const int status = app_.exit(error, out, err);
      throw EarlyExit(status == 0 ? 0 : kWrongUsage, status == 0 ? out.str() : err.str());
    }
    describe_itself();
    options_.outputs = outputs_from(outputs_);
    // Of a dry run, which may name no files.
    if (options_.outputs.empty() && !outputs_.formats.empty()) {
      options_.parameters.formats = outputs_.formats;
    }
    if (options_.command == Command::kMesh) check_mesh();
    if (options_.command == Command::kFetch && options_.outputs.empty()) {
      throw EarlyExit(kWrongUsage, "-o is required\n");
    }
    check_parameters();
    return std::move(options_);
  }

 private:
  CLI::App& command(Command value, const std::string& name, const std::string& help) {
    CLI::App* app = app_.add_subcommand(name, help);
    app->callback([this, value] { options_.command = value; });
    return *app;
  }

  // Ahead of the library, which would tell "FILE: 30 is not there" of "--isoo 30".
  void check_names(int argc, const char* const* argv) const {
    const CLI::App* command = &app_;
    for (int n = 1; n < argc && std::string_view(argv[n]) != "--"; ++n) {
      const std::string word = argv[n];
      const bool is_option = word.starts_with("--") ||
                             (word.size() == 2 && word[0] == '-' && std::isalpha(word[1]) != 0);
      if (!is_option) {
        if (command != &app_ || word.starts_with('-')) continue;
        command = subcommand(word);
        continue;
      }
      const std::string name = word.substr(0, word.find('='));
      const CLI::Option* option = command->get_option_no_throw(name);
      if (option == nullptr) option = std::as_const(app_).get_option_no_throw(name);
      if (option == nullptr) {
        throw EarlyExit(kWrongUsage, "isomesh: there is no option " + name + "; `isomesh" +
                                         (command == &app_ ? "" : ' ' + command->get_name()) +
                                         " --help` lists them\n");
      }
      const bool has_value_behind =
          option->get_items_expected_max() > 0 && name.size() == word.size();
      if (has_value_behind) ++n;
    }
  }

  const CLI::App* subcommand(const std::string& name) const {
    for (const CLI::App* each : app_.get_subcommands([](const CLI::App*) { return true; })) {
      if (each->check_name(name)) return each;
    }
    throw EarlyExit(kWrongUsage,
                    "isomesh: there is no command " + name + "; `isomesh --help` lists them\n");
  }

  void add_descriptions() {
    completion_ = app_.add_subcommand("completion", "Print what a shell completes arguments with");
    completion_->add_option("SHELL", shell_, "bash, zsh or fish")->required();
    manual_ = app_.add_subcommand("manual", "Print the manual page");
    manual_->group("");
  }

  // Ends the program where that was asked for.
  void describe_itself() const {
    if (manual_->parsed()) throw EarlyExit(0, command_line::manual_page(app_, manual()));
    if (!completion_->parsed()) return;
    const auto shell = command_line::shell_from(shell_);
    if (!shell) throw EarlyExit(kWrongUsage, "SHELL must be bash, zsh or fish\n");
    throw EarlyExit(0, command_line::completion(app_, *shell));
  }

  void add_mesh(CLI::App& app) {
    add_file(app, options_);
    add_outputs(app, outputs_);
    add_number<int>(app, "--jobs",
                    "How many FILEs at a time, of those that are meshed each (default: 1)",
                    [&](int jobs) {
                      if (jobs < 1 || jobs > kMostJobs) refuse("--jobs", "must be from 1 to 64");
                      options_.jobs = jobs;
                    });
    app.add_flag(
        "--dry-run", options_.dry_run,
        "Upload, print what the job would make and take, and erase what was not there before");
    add_allow_empty(app, options_);
    add_parameters(app, options_.parameters, options_.preset, Formats::kByFiles);
    add_raw(app, options_);
  }

  void add_local() {
    CLI::App& local =
        command(Command::kMesh, "local",
                "Mesh without a server: on an isomeshd of its own, which ends with it");
    local.callback([this] {
      options_.command = Command::kMesh;
      options_.is_local = true;
    });
    add_mesh(local);
    local
        .add_option("--daemon", options_.daemon,
                    "The program isomeshd, where it is not beside this one or in PATH")
        ->envname("ISOMESHD")
        ->type_name("FILE");
  }

  void check_mesh() const {
    if (options_.outputs.empty() && !options_.dry_run)
      throw EarlyExit(kWrongUsage, "-o is required\n");
    const bool is_piped = std::ranges::any_of(options_.outputs, &Output::is_stdout);
    if (is_piped && (options_.json || options_.outputs.size() > 1)) {
      throw EarlyExit(kWrongUsage, "-o: standard output takes one mesh and nothing else\n");
    }
    if (options_.dry_run && !options_.parameters.label_values.empty()) {
      throw EarlyExit(
          kWrongUsage,
          "--dry-run: estimates go by the labels of the volume's file, not by --label-values\n");
    }
    check_outputs();
  }

  // What the server would refuse is refused before anything is sent to it.
  void check_parameters() const {
    const bool is_job = options_.command == Command::kMesh ||
                        options_.command == Command::kSubmit ||
                        options_.command == Command::kEstimate;
    if (!is_job) return;
    JobParameters parameters = options_.parameters;
    parameters.volume = "any";
    if (!options_.preset.empty()) parameters.iso = 0;
    const std::string url = parameters.callback ? lower(parameters.callback->url) : "http://";
    if (!url.starts_with("http://") && !url.starts_with("https://")) {
      throw EarlyExit(kWrongUsage, "isomesh: --callback: must begin with http:// or https://\n");
    }
    try {
      parse_job_parameters(to_json(parameters));
    } catch (const Error& error) {
      throw EarlyExit(kWrongUsage, std::string("isomesh: ") + error.what() + '\n');
    }
  }

  // Some files hold one label only, and others only labels.
  void check_outputs() const {
    const auto& labels = options_.parameters.labels;
    for (const Output& output : options_.outputs) {
      const std::string file = output.path.string();
      if (!labels && output.format == MeshFormat::kZip) {
        throw EarlyExit(kWrongUsage, "-o: " + file + " is for --labels, a file of each\n");
      }
      const bool holds_one = !holds_all_labels(output.format) && output.format != MeshFormat::kZip;
      if (labels && holds_one && labels->values.size() != 1) {
        throw EarlyExit(kWrongUsage,
                        "-o: " + file +
                            " would hold one label; .glb, .3mf, .ply, .obj, .vtk and .vtp "
                            "hold all, .zip a file of each\n");
      }
    }
  }

  static constexpr int kMostJobs = 64;

  Options options_;
  GivenOutputs outputs_;
  CLI::App app_;
  CLI::App* completion_ = nullptr;
  CLI::App* manual_ = nullptr;
  std::string shell_;
};

}  // namespace

Options parse_options(int argc, const char* const* argv) { return Parser().parse(argc, argv); }

}  // namespace isomesh::cli
