// isomesh-verify: holds a mesh against the volume that it was made of.
#include <exception>
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "base/command_line/help.h"
#include "base/command_line/manual.h"
#include "base/files.h"
#include "client/verify/verify.h"

namespace {

using namespace isomesh;

constexpr const char* kStatuses =
    "Exit status: 0 every point is within the bound, both ways, and the edges fit; 1 not, or not "
    "shown; 2 wrong "
    "usage, or a file that cannot be read.";

struct Arguments {
  std::string mesh;
  std::string volume;
  import::ImportOptions import;
  verify::Cut cut;
  verify::Question question;
  std::vector<double> crop;
};

void add_options(CLI::App& app, Arguments& arguments) {
  verify::Cut& cut = arguments.cut;
  app.formatter(command_line::wrapped_help());
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("-V,--version", "isomesh-verify " ISOMESH_VERSION,
                       "Print the version and exit");
  app.footer(command_line::wrapped(kStatuses, 0));
  const auto add = [&](const char* name, auto& value, const char* type, const char* help) {
    return app.add_option(name, value, help)->type_name(type);
  };
  add("FILE", arguments.mesh, "FILE",
      "The mesh: STL, PLY, or GLB without a codec, as isomesh wrote it")
      ->required();
  add("--volume", arguments.volume, "FILE",
      "The volume that it was made of: a file, a folder or an archive")
      ->required();
  add("--iso", cut.iso, "VALUE", "The iso-value of the job")->required();
  add("--bound", arguments.question.bound, "MM",
      "The distance to check: max_error_mm of the job, or bound_mm of its certificate")
      ->required()
      ->check(CLI::PositiveNumber);
  add("--scheme", cut.tetrahedra, "5|6", "Tetrahedra of a cell, as in the job")
      ->check(CLI::IsMember({5, 6}))
      ->capture_default_str();
  add("--crop", arguments.crop, "X,Y,Z,X,Y,Z",
      "The box of the job, in millimetres, LPS; closes the surface")
      ->delimiter(',')
      ->expected(6);
  app.add_flag("--close", cut.close, "The job closed the surface at the border of the volume");
  app.add_flag("--midpoint", cut.midpoint, "The job had the interpolation midpoint");
  app.add_flag(
      "--keep-components,--fill-cavities", arguments.question.some_parts,
      "The job left components out: only those that the mesh comes near to are looked for");
  add("--series", arguments.import.series, "UID", "UID of the DICOM series, if there are several");
  add("--member", arguments.import.member, "NAME",
      "The archive's member, if it holds several volumes");
  add("--accept", arguments.import.accept, "CODE,..", "Notes on the volume that were accepted")
      ->delimiter(',');
}

int run(const Arguments& arguments) {
  const InputFile file = InputFile::chosen(arguments.mesh);
  verify::Surface mesh = verify::read_surface(file.text(0, file.size()));
  verify::Field field = verify::read_field(arguments.volume, arguments.import);
  verify::Cut cut = arguments.cut;
  if (!arguments.crop.empty()) {
    const auto& box = arguments.crop;
    field = field.cropped({verify::Vec{box[0], box[1], box[2]}, {box[3], box[4], box[5]}});
    cut.close = true;
  }
  verify::Surface surface = verify::zero_set(field, cut);
  verify::Question question = arguments.question;
  question.is_closed = cut.close;
  const verify::Verdict verdict = verify::verify(mesh, surface, field, question);
  std::cout << verdict.text << std::flush;
  return verdict.holds ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  constexpr int kBadInput = 2;
  Arguments arguments;
  CLI::App app(
      "Checks that every point of a mesh is within a distance of the surface of its volume, and "
      "the other way round.",
      "isomesh-verify");
  try {
    add_options(app, arguments);
    if (argc == 2 && std::string_view(argv[1]) == "manual") {
      std::cout << command_line::manual_page(
          app, {.number = 1,
                .version = ISOMESH_VERSION,
                .name = "check a mesh against its volume",
                .sections = {{"Exit status", kStatuses}, {"See also", "isomesh(1)"}}});
      return 0;
    }
    app.parse(argc, argv);
    return run(arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  } catch (const std::exception& error) {
    std::cerr << "isomesh-verify: " << error.what() << '\n';
    return kBadInput;
  }
}
