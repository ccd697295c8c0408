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

#include "base/text.h"
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

template <class Enum>
std::vector<std::string> names_from() {
  std::vector<std::string> names;
  for (const Enum value : values_of<Enum>()) names.emplace_back(to_string(value));
  return names;
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

// What a parameter is by default, and what it may be where that are some words. Ranges are the
// server's to check: it names the limits that it has.
template <class T>
std::string values_and_default(const Parameter& parameter, const T& standard) {
  if constexpr (std::is_same_v<T, Scheme>) {
    return ": 5 or 6 (default: " + std::to_string(static_cast<int>(standard)) + ")";
  } else if constexpr (Enumeration<T>) {
    return ": " + listed(names_from<T>()) + " (default: " + std::string(to_string(standard)) + ")";
  } else if constexpr (std::is_same_v<T, std::vector<MeshFormat>>) {
    return ", of " + listed(names_from<MeshFormat>()) +
           " (default: " + std::string(to_string(standard.front())) + ")";
  } else if constexpr (std::is_same_v<T, int> || std::is_same_v<T, std::int64_t> ||
                       std::is_same_v<T, double>) {
    return " (default: " + number_text(standard) + ")";
  } else {
    std::string defaults;
    for (const auto& entry : parameter.cases) {
      if (!entry || !entry->standard) continue;
      defaults += (defaults.empty() ? " (default: " : ", ") + number_text(*entry->standard) +
                  " for " + std::string(to_string(entry->smoothing));
    }
    return defaults.empty() ? "" : defaults + ")";
  }
}

// One line of the table, as it reads on a terminal.
template <class T>
std::string help_of(const Parameter& parameter, const T& standard) {
  std::string help = parameter.help;
  std::erase(help, '`');
  if (help.ends_with('.')) help.pop_back();
  const std::string unit = parameter.unit;
  return help + (unit.empty() ? "" : ", in " + unit) + values_and_default(parameter, standard);
}

// An option for each kind of parameter.
class ParameterOptions {
 public:
  explicit ParameterOptions(CLI::App& app) : app_(app) {}

  template <class T>
  CLI::Option* add(const Parameter& parameter, T& value) {
    const std::string name = "--" + option_name_of(parameter);
    return add_kind(name, parameter, help_of(parameter, value), value);
  }

 private:
  template <class Number>
  requires std::is_arithmetic_v<Number> CLI::Option* add_kind(const std::string& name,
                                                              const Parameter& /*parameter*/,
                                                              const std::string& help,
                                                              Number& value) {
    return add_number<Number>(app_, name, help, [&value](Number given) { value = given; });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, bool& value) {
    return app_.add_flag(name, value, help);
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, Scheme& value) {
    return add_number<int>(app_, name, help, [&value](int given) { value = Scheme{given}; });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, Enumeration auto& value) {
    using Enum = std::remove_reference_t<decltype(value)>;
    return add_name<Enum>(app_, name, help, [&value](Enum given) { value = given; });
  }

  template <class Number>
  requires std::is_arithmetic_v<Number> CLI::Option* add_kind(const std::string& name,
                                                              const Parameter& parameter,
                                                              const std::string& help,
                                                              std::optional<Number>& value) {
    if (parameter.when_empty == nullptr) {
      return add_number<Number>(app_, name, help, [&value](Number given) { value = given; });
    }
    const std::string word = parameter.when_empty;
    return isomesh::cli::add(app_, name, "N|" + word, help,
                             [&value, name, word](const std::string& text) {
                               value = number_from<Number>(text);
                               if (!value && text != word) {
                                 refuse(name, "must be a number or " + word);
                               }
                             });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::vector<MeshFormat>& value) {
    return isomesh::cli::add(app_, name, "NAME,..", help, [&value, name](const std::string& text) {
      value.clear();
      std::stringstream names(text);
      for (std::string format; std::getline(names, format, ',');) {
        value.push_back(name_from<MeshFormat>(name, format));
      }
    });
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::optional<LabelChoice>& value) {
    return isomesh::cli::add(app_, name, "all|N,..", help, [&value, name](const std::string& text) {
      value.emplace();
      if (text != "all") value->values = labels_from(name, text);
    });
  }

  // `--label-name 3=Liver`, once for each label.
  template <class T>
  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::map<std::int64_t, T>& value) {
    constexpr bool kIsList = std::is_same_v<T, std::vector<std::int64_t>>;
    return app_
        .add_option_function<std::vector<std::string>>(
            name,
            [&value, name](const std::vector<std::string>& texts) {
              for (const std::string& text : texts) {
                const std::size_t sign = text.find('=');
                const auto label = number_from<std::int64_t>(std::string_view(text).substr(0, sign));
                if (sign == std::string::npos || !label) {
                  refuse(name, "\"" + text + "\" must begin with a label and =");
                }
                const std::string own = text.substr(sign + 1);
                if constexpr (kIsList) {
                  value[*label] = labels_from(name, own);
                } else {
                  value[*label] = own;
                }
              }
            },
            help + ". May be repeated")
        ->type_name(kIsList ? "LABEL=N,.." : "LABEL=TEXT")
        ->expected(1)
        ->take_all();
  }

  static std::vector<std::int64_t> labels_from(const std::string& name, const std::string& text) {
    std::vector<std::int64_t> labels;
    for (const std::string_view each : split(text, ',')) {
      const auto label = number_from<std::int64_t>(each);
      if (!label) refuse(name, "must be whole numbers separated by commas");
      labels.push_back(*label);
    }
    return labels;
  }

  CLI::Option* add_kind(const std::string& name, const Parameter& /*parameter*/,
                        const std::string& help, std::optional<Callback>& value) {
    return isomesh::cli::add(app_, name, "URL", help,
                             [&value](const std::string& text) { value = Callback{text}; });
  }

  CLI::App& app_;
};

// The formats are given otherwise where the mesh is written to files.
enum class Formats { kAsOption, kByFiles };

// What is required, and what needs or excludes what.
void relate(const Parameter& parameter, const std::map<std::string, CLI::Option*>& options) {
  CLI::Option* const option = options.at(parameter.name);
  if (parameter.needs != nullptr) option->needs(options.at(parameter.needs));
  if (!parameter.is_required) {
    option->group("Job");
  } else if (parameter.unless == nullptr) {
    option->required();
  } else {
    CLI::Option* const other = options.at(parameter.unless);
    option->excludes(other);
  }
}

void add_parameters(CLI::App& app, JobParameters& parameters, Formats formats) {
  ParameterOptions all(app);
  std::map<std::string, CLI::Option*> options;  // by the parameters' names
  std::vector<Parameter> added;
  visit_leaves(parameters,
               [&](const std::string& /*path*/, const Parameter& parameter, auto& member) {
                 using Member = std::remove_reference_t<decltype(member)>;
                 const bool is_formats = std::is_same_v<Member, std::vector<MeshFormat>>;
                 if (is_formats && formats == Formats::kByFiles) return;
                 // The volume is the command's file or its first argument.
                 if constexpr (!std::is_same_v<Member, std::string>) {
                   options[parameter.name] = all.add(parameter, member);
                   added.push_back(parameter);
                 }
               });
  for (const Parameter& parameter : added) relate(parameter, options);
  CLI::Option* const labels = options.at("labels");
  options.at("interpolation")->excludes(labels);  // their vertices lie half-way
  app.parse_complete_callback(
      [&parameters, labels, iso = options.at("iso"), passes = options.at("passes")] {
        if (labels->count() + iso->count() == 0) throw CLI::RequiredError("--iso or --labels");
        const bool is_by_labels = labels->count() > 0;
        if (is_by_labels && passes->count() == 0) parameters.passes = label_parameters({}).passes;
      });
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
