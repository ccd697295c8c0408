#include "client/cli/options.h"

#include <sstream>
#include <string_view>
#include <utility>

#include <CLI/CLI.hpp>

#include "base/text.h"
#include "client/cli/option_values.h"
#include "client/cli/parameter_options.h"
#include "proto/parameters.h"

namespace isomesh::cli {
namespace {

constexpr const char* kDescription = "Turns volumes into surface meshes on an isomesh server.";

constexpr const char* kExamples = R"(
Examples:
  isomesh mesh head.nii.gz --iso 60 -o head.drc
  isomesh mesh ct.nrrd --iso otsu --passes 10 -o bone.glb -o bone.stl
  isomesh mesh ct.raw --dims 512,512,300 --type int16 --spacing 0.7,0.7,1 --iso 300 -o ct.stl
  isomesh mesh organs.seg.nrrd --labels all -o body.glb -o organs.zip
  isomesh submit $(isomesh upload head.nii.gz) --iso 60 --format drc,stl
  isomesh --server https://meshes.example.org --json list

Exit status: 0 done, 1 the job failed or was refused, 2 wrong usage, 3 the server could not be
reached.)";

void add_file(CLI::App& app, Options& options) {
  app.add_option_function<std::vector<std::string>>(
         "FILE",
         [&](const std::vector<std::string>& paths) {
           for (const std::string& path : paths) {
             std::error_code error;
             if (!std::filesystem::exists(path, error)) refuse("FILE", path + " is not there");
             options.files.emplace_back(path);
           }
         },
         "NIfTI, NRRD, MetaImage, VTI, DICOM, a folder or archive of one, or raw samples with "
         "--dims and --type; several files that belong together, such as .hdr and .img")
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
                   });
  auto* type = add_name<SampleType>(app, "--type", "Such as uint8, int16, float32",
                                    [raw](SampleType value) { raw().type = value; });
  dims->needs(type);
  type->needs(dims);
  std::vector<CLI::Option*> others = {
      add(app, "--spacing", "X,Y,Z", "Millimetres between samples",
          [raw](const std::string& text) {
            raw().geometry.spacing = numbers_from<double, 3>("--spacing", text);
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

// ".drc, .glb or .stl": what a file's name may end in.
std::string suffixes() {
  std::vector<std::string> all;
  for (const std::string& name : names_from<MeshFormat>()) all.push_back('.' + name);
  return listed(all);
}

MeshFormat format_of(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  const auto format = from_string<MeshFormat>(suffix.empty() ? suffix : suffix.substr(1));
  if (!format) refuse("-o", path.string() + " must end in " + suffixes());
  return *format;
}

void add_outputs(CLI::App& app, Options& options) {
  app.add_option_function<std::vector<std::string>>(
         "-o,--output",
         [&](const std::vector<std::string>& paths) {
           for (const std::filesystem::path path : paths) {
             const auto folder = path.has_parent_path() ? path.parent_path() : ".";
             std::error_code error;
             if (!std::filesystem::is_directory(folder, error)) {
               refuse("-o", "the folder of " + path.string() + " is not there");
             }
             options.outputs.push_back({path, format_of(path)});
           }
         },
         "Where the mesh goes; the suffix (" + suffixes() + ") says the format. May be repeated")
      ->type_name("OUT")
      ->expected(1)
      ->take_all()
      ->required();
}

void add_id(CLI::App& app, Options& options, const std::string& name) {
  app.add_option(name, options.id, "Its id")->required();
}

class Parser {
 public:
  Parser() : app_(kDescription, "isomesh") {
    app_.set_version_flag("--version", "isomesh " ISOMESH_VERSION);
    app_.require_subcommand(1);
    app_.fallthrough();
    app_.footer(kExamples);
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

    CLI::App& mesh = command(Command::kMesh, "mesh", "Upload a volume, mesh it, download the mesh");
    add_file(mesh, options_);
    add_outputs(mesh, options_);
    add_parameters(mesh, options_.parameters, Formats::kByFiles);
    add_raw(mesh, options_);

    CLI::App& upload = command(Command::kUpload, "upload", "Upload a volume and print its id");
    add_file(upload, options_);
    add_raw(upload, options_);

    CLI::App& submit = command(Command::kSubmit, "submit", "Start a job and print its id");
    add_id(submit, options_, "VOLUME");
    add_parameters(submit, options_.parameters, Formats::kAsOption);
    submit
        .add_option("--key", options_.key,
                    "Idempotency key: the same one gives the same job again (default: a new one)")
        ->type_name("KEY");

    CLI::App& estimate =
        command(Command::kEstimate, "estimate", "Say what a job would make and take");
    add_id(estimate, options_, "VOLUME");
    add_parameters(estimate, options_.parameters, Formats::kAsOption);

    add_id(command(Command::kStatus, "status", "Show a job"), options_, "JOB");
    add_id(command(Command::kWait, "wait", "Wait for a job and show it"), options_, "JOB");

    CLI::App& fetch = command(Command::kFetch, "fetch", "Download the mesh of a finished job");
    add_id(fetch, options_, "JOB");
    add_outputs(fetch, options_);
    add_number<std::int64_t>(fetch, "--label", "Of a job by labels: this label's own surface",
                             [&](std::int64_t label) { options_.label = label; });

    add_id(command(Command::kCancel, "cancel", "Cancel a job"), options_, "JOB");

    CLI::App& rename = command(Command::kRename, "rename", "Give a volume another name");
    add_id(rename, options_, "VOLUME");
    rename.add_option("NAME", options_.name, "What it is called; empty for no name")->required();

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
  }

  Options parse(int argc, const char* const* argv) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      std::ostringstream out;
      std::ostringstream err;
      const int status = app_.exit(error, out, err);
      throw EarlyExit(status == 0 ? 0 : kWrongUsage, status == 0 ? out.str() : err.str());
    }
    if (options_.command == Command::kMesh) check_outputs();
    if (options_.command == Command::kEstimate && !options_.parameters.label_values.empty()) {
      throw EarlyExit(kWrongUsage,
                      "--label-values: estimates go by the labels of the volume's file\n");
    }
    return std::move(options_);
  }

 private:
  CLI::App& command(Command value, const std::string& name, const std::string& help) {
    CLI::App* app = app_.add_subcommand(name, help);
    app->callback([this, value] { options_.command = value; });
    return *app;
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
        throw EarlyExit(kWrongUsage, "-o: " + file +
                                         " would hold one label; .glb, .ply and .obj hold all, "
                                         ".zip a file of each\n");
      }
    }
  }

  Options options_;
  CLI::App app_;
};

}  // namespace

Options parse_options(int argc, const char* const* argv) { return Parser().parse(argc, argv); }

}  // namespace isomesh::cli
