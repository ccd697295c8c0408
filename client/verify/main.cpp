// isomesh-verify: holds a mesh against the volume that it was made of.
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/command_line/help.h"
#include "base/command_line/manual.h"
#include "base/error.h"
#include "base/files.h"
#include "base/text.h"
#include "client/verify/verify.h"

namespace {

using namespace isomesh;

constexpr const char* kStatuses =
    "0: every point is within the bound, both ways, and the edges fit. 1: not so, or not shown to "
    "be so. 2: wrong usage, or a file that cannot be read.";

struct Arguments {
  std::string mesh;
  std::string volume;
  import::ImportOptions import;
  verify::Cut cut;
  verify::Question question;
  std::vector<double> crop;
  std::string inside = "above";
};

std::array<double, 3> point_from(const std::string& text) {
  const std::vector<std::string_view> parts = split(text, ',');
  std::array<double, 3> point = {};
  for (std::size_t axis = 0; axis < point.size(); ++axis) {
    const auto number = axis < parts.size() ? parse_double(parts[axis]) : std::nullopt;
    if (!number || parts.size() != point.size()) {
      throw CLI::ValidationError("--keep-nearest-to", "a point is three numbers, X,Y,Z");
    }
    point[axis] = *number;
  }
  return point;
}

void add_options(CLI::App& app, Arguments& all) {
  const auto add = [&](const char* name, auto& value, const char* type, const char* help) {
    return app.add_option(name, value, help)->type_name(type);
  };
  add("FILE", all.mesh, "FILE",
      "The mesh of a job at an iso-value: STL, PLY or GLB, without a codec")
      ->required();
  add("--volume", all.volume, "FILE", "Its volume: a file, a folder or an archive")->required();
  add("--iso", all.cut.iso, "VALUE", "The iso-value of the job");
  add("--bound", all.question.bound, "MM",
      "The distance from the extracted surface, such as the job's --max-error");
  add("--scheme", all.cut.tetrahedra, "5|6", "As in the job")->check(CLI::IsMember({5, 6}));
  add("--inside", all.inside, "above|below", "As in the job")
      ->check(CLI::IsMember({"above", "below"}));
  add("--crop", all.crop, "X,Y,Z,X,Y,Z", "As in the job; closes")->delimiter(',')->expected(6);
  app.add_flag("--close,!--no-close", all.cut.close,
               "The job closed the surface at the volume's border, or did not");
  app.add_flag("--midpoint,!--no-midpoint", all.cut.midpoint,
               "The job had --interpolation midpoint, or linear");
  app.add_flag("--fill-cavities,!--no-fill-cavities", all.cut.fill, "As in the job");
  add("--keep-components", all.question.components.keep, "N", "As in the job: the N largest")
      ->check(CLI::PositiveNumber);
  add("--min-component-triangles", all.question.components.min_triangles, "N", "As in the job")
      ->check(CLI::PositiveNumber);
  app.add_option_function<std::vector<std::string>>(
         "--keep-nearest-to",
         [&all](const std::vector<std::string>& places) {
           for (const std::string& place : places) {
             all.question.components.nearest_to.push_back(point_from(place));
           }
         },
         "As in the job, several times for several points")
      ->type_name("X,Y,Z");
  add("--series", all.import.series, "UID", "The DICOM series, if there are several");
  add("--member", all.import.member, "NAME", "The archive's member, if there are several");
  add("--accept", all.import.accept, "CODE,..", "Accept these notes on the volume")->delimiter(',');
  app.formatter(command_line::wrapped_help());
  app.footer(command_line::wrapped(std::string("Exit status: ") + kStatuses, 0));
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("-V,--version", "isomesh-verify " ISOMESH_VERSION, "Print it and exit");
}

// Options that are not given follow the job that made the file, if that says so.
void follow(const MeshParameters& made, const CLI::App& app, Arguments& all) {
  if (made.scheme == SchemeName::kBcc) {
    throw invalid_parameter("file", "files of scheme bcc cannot be checked");
  }
  const auto is_open = [&](const char* option) { return app.count(option) == 0; };
  if (is_open("--iso")) all.cut.iso = made.iso.value_or(0);
  if (is_open("--bound") && made.max_error_mm) all.question.bound = *made.max_error_mm;
  if (is_open("--scheme")) all.cut.tetrahedra = made.scheme == SchemeName::kFive ? 5 : 6;
  if (is_open("--inside")) all.inside = to_string(made.inside);
  if (is_open("--close")) all.cut.close = made.close;
  if (is_open("--midpoint")) all.cut.midpoint = made.interpolation == Interpolation::kMidpoint;
  if (is_open("--fill-cavities")) all.cut.fill = made.fill_cavities;
  if (is_open("--crop") && made.crop) {
    for (const auto& corner : *made.crop)
      all.crop.insert(all.crop.end(), corner.begin(), corner.end());
  }
  ComponentFilter& filter = all.question.components;
  if (is_open("--keep-components")) filter.keep = made.components.keep;
  if (is_open("--min-component-triangles")) filter.min_triangles = made.components.min_triangles;
  if (is_open("--keep-nearest-to")) filter.nearest_to = made.components.nearest_to;
}

int run(const CLI::App& app, Arguments& all) {
  verify::Cut& cut = all.cut;
  const InputFile file = InputFile::chosen(all.mesh);
  const std::string bytes = file.text(0, file.size());
  verify::Surface mesh = verify::read_surface(bytes);
  const auto made = verify::read_parameters(bytes);
  if (made) follow(*made, app, all);
  const auto require = [&](const char* option, bool is_told) {
    if (app.count(option) > 0 || is_told) return;
    throw Error(ErrorCode::kInvalidParameter,
                std::string(option) + " is required; the file does not tell it");
  };
  require("--iso", made && made->iso);
  require("--bound", made && made->max_error_mm);
  if (!(all.question.bound > 0) || !std::isfinite(all.question.bound + cut.iso)) {
    throw invalid_parameter("bound", "the bound must be positive, and the iso-value finite");
  }
  verify::Field field = verify::read_field(all.volume, all.import);
  if (!all.crop.empty()) {
    field = field.cropped({verify::Vec{all.crop[0], all.crop[1], all.crop[2]},
                           verify::Vec{all.crop[3], all.crop[4], all.crop[5]}});
    cut.close = true;
  }
  if (all.inside == "below") verify::turn_over(cut, field);
  all.question.is_closed = cut.close;
  if (cut.fill) verify::fill_cavities(cut, field);
  verify::Surface surface = verify::zero_set(field, cut);
  const verify::Verdict verdict = verify::verify(mesh, surface, field, all.question);
  std::cout << verdict.text << std::flush;
  return verdict.holds ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int kBadInput = 2;
  Arguments arguments;
  CLI::App app("Holds a mesh of isomesh against the volume that it was made of.", "isomesh-verify");
  add_options(app, arguments);
  try {
    if (argc == 2 && std::string_view(argv[1]) == "manual") {
      std::cout << command_line::manual_page(
          app, {1,
                ISOMESH_VERSION,
                "check a mesh against its volume",
                {{"Exit status", kStatuses}, {"See also", "isomesh(1)"}}});
      return 0;
    }
    app.parse(argc, argv);
    return run(app, arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  } catch (const std::exception& error) {
    // It may repeat what a file says.
    std::cerr << "isomesh-verify: " << printable_lines(error.what()) << '\n';
    return kBadInput;
  }
}
