#include "client/cli/options.h"

#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <span>
#include <sstream>
#include <string_view>
#include <utility>

#include <CLI/CLI.hpp>

namespace isomesh::cli {
namespace {

constexpr const char* kDescription = "Turns volumes into surface meshes on an isomesh server.";

constexpr const char* kExamples = R"(
Examples:
  isomesh mesh head.nii.gz --iso 60 -o head.drc
  isomesh mesh ct.nrrd --iso otsu --passes 10 -o bone.glb -o bone.stl
  isomesh mesh ct.raw --dims 512,512,300 --type int16 --spacing 0.7,0.7,1 --iso 300 -o ct.stl
  isomesh submit $(isomesh upload head.nii.gz) --iso 60 --format drc,stl
  isomesh --server https://meshes.example.org --json list

Exit status: 0 done, 1 the job failed or was refused, 2 wrong usage, 3 the server could not be
reached.)";

[[noreturn]] void refuse(const std::string& option, const std::string& message) {
  throw CLI::ValidationError(option, message);
}

template <class Number>
std::optional<Number> number_from(std::string_view text) {
  Number number{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(number)) return std::nullopt;
  }
  return number;
}

// Exactly as many numbers as the target has, separated by commas.
template <class Number, std::size_t N>
std::array<Number, N> numbers_from(const std::string& option, std::string_view text) {
  std::array<Number, N> numbers{};
  for (std::size_t n = 0; n < N; ++n) {
    const std::size_t end = std::min(text.find(','), text.size());
    const auto number = number_from<Number>(text.substr(0, end));
    const bool last = n + 1 == N;
    if (!number || last != (end == text.size())) {
      refuse(option, "must be " + std::to_string(N) + " numbers separated by commas");
    }
    numbers[n] = *number;
    text.remove_prefix(last ? end : end + 1);
  }
  return numbers;
}

template <class Enum>
Enum name_from(const std::string& option, const std::string& text) {
  const auto value = from_string<Enum>(text);
  if (!value) refuse(option, "must be " + names_of<Enum>());
  return *value;
}

// `--option VALUE` that calls `take(VALUE)`.
CLI::Option* add(CLI::App& app, const std::string& name, const std::string& value,
                 const std::string& help, const std::function<void(const std::string&)>& take) {
  return app.add_option_function<std::string>(name, take, help)->type_name(value);
}

template <class Number>
CLI::Option* add_number(CLI::App& app, const std::string& name, const std::string& help,
                        std::function<void(Number)> take) {
  return add(app, name, "N", help, [name, take = std::move(take)](const std::string& text) {
    const auto number = number_from<Number>(text);
    if (!number) refuse(name, "\"" + text + "\" is not a number");
    take(*number);
  });
}

template <class Enum>
CLI::Option* add_name(CLI::App& app, const std::string& name, const std::string& help,
                      std::function<void(Enum)> take) {
  return add(app, name, "NAME", help, [name, take = std::move(take)](const std::string& text) {
    take(name_from<Enum>(name, text));
  });
}

void add_file(CLI::App& app, Options& options) {
  app.add_option_function<std::string>(
         "FILE",
         [&](const std::string& text) {
           options.file = text;
           std::error_code error;
           if (!std::filesystem::exists(options.file, error))
             refuse("FILE", text + " is not there");
         },
         "NIfTI, NRRD, MetaImage, VTI, DICOM, a folder or archive of one, or raw samples with "
         "--dims and --type")
      ->required();
  add(app, "--series", "UID", "The DICOM series to take, where there are several",
      [&](const std::string& text) { options.series = text; })
      ->group("Upload");
  app.add_flag("--digest", options.digest, "Have the server check the file's SHA-256")
      ->group("Upload");
}

void add_raw(CLI::App& app, Options& options) {
  const auto raw = [&options]() -> RawDescription& {
    return options.raw ? *options.raw : options.raw.emplace();
  };
  auto* dims = add(app, "--dims", "X,Y,Z", "Samples along x, y and z; x runs fastest",
                   [raw](const std::string& text) {
                     raw().dims = numbers_from<std::int64_t, 3>("--dims", text);
                   });
  auto* type = add_name<SampleType>(app, "--type", "Such as uint8, int16, float32",
                                    [raw](SampleType value) { raw().type = value; });
  dims->needs(type);
  type->needs(dims);
  std::vector<CLI::Option*> others = {
      add(app, "--spacing", "X,Y,Z", "Millimetres between samples",
          [raw](const std::string& text) {
            raw().spacing = numbers_from<double, 3>("--spacing", text);
          }),
      add(app, "--origin", "X,Y,Z", "Where the first sample lies, in millimetres (LPS)",
          [raw](const std::string& text) {
            raw().origin = numbers_from<double, 3>("--origin", text);
          }),
      add(app, "--direction", "A,..,I", "Nine numbers, row by row; columns are the axes",
          [raw](const std::string& text) {
            raw().direction = numbers_from<double, 9>("--direction", text);
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

void add_parameters(CLI::App& app, JobParameters& parameters) {
  add(app, "--iso", "N|otsu", "The iso-value, in the volume's units, or Otsu's threshold",
      [&](const std::string& text) {
        parameters.iso = number_from<double>(text);
        if (!parameters.iso && text != "otsu") refuse("--iso", "must be a number or otsu");
      })
      ->required();
  // Ranges are the server's to check: it names the limits that it has.
  const std::vector<CLI::Option*> others = {
      add_number<int>(app, "--scheme", "Tetrahedra per cell, 5 or 6 (default: 6)",
                      [&](int value) { parameters.scheme = Scheme{value}; }),
      add_name<Interpolation>(app, "--interpolation", "linear (the default) or midpoint",
                              [&](Interpolation value) { parameters.interpolation = value; }),
      add_number<int>(app, "--passes", "Smoothing passes (default: 5)",
                      [&](int value) { parameters.passes = value; }),
      add_name<Smoothing>(app, "--smoothing", "laplacian (the default) or taubin",
                          [&](Smoothing value) { parameters.smoothing = value; }),
      add_number<double>(app, "--lambda", "How far a step moves a vertex (default: 1; taubin 0.33)",
                         [&](double value) { parameters.lambda = value; }),
      add_number<double>(app, "--pass-band", "Of taubin: what it keeps (default: 0.1)",
                         [&](double value) { parameters.pass_band = value; }),
      add_number<double>(app, "--max-displacement",
                         "Millimetres that no vertex leaves its place by",
                         [&](double value) { parameters.max_displacement_mm = value; }),
      app.add_flag("--close", parameters.close, "Cap the surface at the volume's border"),
      add_number<std::uint32_t>(app, "--keep-components", "Keep only so many of the largest parts",
                                [&](std::uint32_t value) { parameters.components.keep = value; }),
      add_number<std::uint32_t>(
          app, "--min-triangles", "Keep only parts of so many triangles",
          [&](std::uint32_t value) { parameters.components.min_triangles = value; }),
      add_number<int>(app, "--position-bits", "Of Draco, per coordinate (default: 14)",
                      [&](int value) { parameters.draco.position_bits = value; }),
      add_number<int>(app, "--speed", "Of Draco, 0 smallest to 10 fastest (default: 7)",
                      [&](int value) { parameters.draco.speed = value; }),
      app.add_flag("--normals", parameters.normals, "Put normals into a GLB"),
      add_name<Priority>(app, "--priority", "stat, routine (the default) or bulk",
                         [&](Priority value) { parameters.priority = value; }),
      add(app, "--callback", "URL", "Have the server tell this address when the job has ended",
          [&](const std::string& text) { parameters.callback = Callback{text}; })};
  for (CLI::Option* option : others) option->group("Job");
}

MeshFormat format_of(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  const auto format = from_string<MeshFormat>(suffix.empty() ? suffix : suffix.substr(1));
  if (!format) refuse("-o", path.string() + " must end in .drc, .glb, .stl, .ply or .obj");
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
         "Where the mesh goes; the suffix (.drc .glb .stl .ply .obj) says the format. May be "
         "repeated")
      ->type_name("OUT")
      ->expected(1)
      ->take_all()
      ->required();
}

void add_formats(CLI::App& app, JobParameters& parameters) {
  add(app, "--format", "NAME,..", "Of drc, glb, stl, ply and obj (default: drc)",
      [&](const std::string& text) {
        parameters.formats.clear();
        std::stringstream names(text);
        for (std::string name; std::getline(names, name, ',');) {
          parameters.formats.push_back(name_from<MeshFormat>("--format", name));
        }
      })
      ->group("Job");
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
    add_parameters(mesh, options_.parameters);
    add_raw(mesh, options_);

    CLI::App& upload = command(Command::kUpload, "upload", "Upload a volume and print its id");
    add_file(upload, options_);
    add_raw(upload, options_);

    CLI::App& submit = command(Command::kSubmit, "submit", "Start a job and print its id");
    add_id(submit, options_, "VOLUME");
    add_parameters(submit, options_.parameters);
    add_formats(submit, options_.parameters);
    submit
        .add_option("--key", options_.key,
                    "Idempotency key: the same one gives the same job again (default: a new one)")
        ->type_name("KEY");

    CLI::App& estimate =
        command(Command::kEstimate, "estimate", "Say what a job would make and take");
    add_id(estimate, options_, "VOLUME");
    add_parameters(estimate, options_.parameters);
    add_formats(estimate, options_.parameters);

    add_id(command(Command::kStatus, "status", "Show a job"), options_, "JOB");
    add_id(command(Command::kWait, "wait", "Wait for a job and show it"), options_, "JOB");

    CLI::App& fetch = command(Command::kFetch, "fetch", "Download the mesh of a finished job");
    add_id(fetch, options_, "JOB");
    add_outputs(fetch, options_);

    add_id(command(Command::kCancel, "cancel", "Cancel a job"), options_, "JOB");

    CLI::App& list = command(Command::kList, "list", "List jobs, or volumes");
    add_name<JobState>(list, "--state", "Only jobs in this state",
                       [&](JobState state) { options_.state = state; });
    list.add_option("--cursor", options_.cursor, "The page to show, as the one before names it")
        ->type_name("CURSOR");
    list.add_flag("--volumes", options_.volumes, "List volumes instead");

    add_id(command(Command::kInfo, "info", "Show a volume"), options_, "VOLUME");
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
    return std::move(options_);
  }

 private:
  CLI::App& command(Command value, const std::string& name, const std::string& help) {
    CLI::App* app = app_.add_subcommand(name, help);
    app->callback([this, value] { options_.command = value; });
    return *app;
  }

  Options options_;
  CLI::App app_;
};

}  // namespace

Options parse_options(int argc, const char* const* argv) { return Parser().parse(argc, argv); }

}  // namespace isomesh::cli
