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
};

void add_options(CLI::App& app, Arguments& all) {
  const auto add = [&](const char* name, auto& value, const char* type, const char* help) {
    return app.add_option(name, value, help)->type_name(type);
  };
  add("FILE", all.mesh, "FILE",
      "The mesh of a job at an iso-value: STL, PLY or GLB, without a codec")
      ->required();
  add("--volume", all.volume, "FILE", "Its volume: a file, a folder or an archive")->required();
  add("--iso", all.cut.iso, "VALUE", "The iso-value of the job")->required();
  add("--bound", all.question.bound, "MM",
      "The distance from the extracted surface, such as the job's --max-error")
      ->required();
  add("--scheme", all.cut.tetrahedra, "5|6", "As in the job")->check(CLI::IsMember({5, 6}));
  add("--crop", all.crop, "X,Y,Z,X,Y,Z", "As in the job; closes")->delimiter(',')->expected(6);
  app.add_flag("--close", all.cut.close, "The job closed the surface at the volume's border");
  app.add_flag("--midpoint", all.cut.midpoint, "The job had --interpolation midpoint");
  app.add_flag(
      "--keep-components,--fill-cavities", all.question.some_parts,
      "Components of the surface may be missing if the mesh comes near to none of their points");
  add("--series", all.import.series, "UID", "The DICOM series, if there are several");
  add("--member", all.import.member, "NAME", "The archive's member, if there are several");
  add("--accept", all.import.accept, "CODE,..", "Accept these notes on the volume")->delimiter(',');
  app.formatter(command_line::wrapped_help());
  app.footer(command_line::wrapped(std::string("Exit status: ") + kStatuses, 0));
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("-V,--version", "isomesh-verify " ISOMESH_VERSION, "Print it and exit");
}

int run(Arguments& all) {
  verify::Cut& cut = all.cut;
  if (!(all.question.bound > 0) || !std::isfinite(all.question.bound + cut.iso)) {
    throw invalid_parameter("bound", "the bound must be positive, and the iso-value finite");
  }
  const InputFile file = InputFile::chosen(all.mesh);
  verify::Surface mesh = verify::read_surface(file.text(0, file.size()));
  verify::Field field = verify::read_field(all.volume, all.import);
  if (!all.crop.empty()) {
    field = field.cropped({verify::Vec{all.crop[0], all.crop[1], all.crop[2]},
                           verify::Vec{all.crop[3], all.crop[4], all.crop[5]}});
    cut.close = true;
  }
  all.question.is_closed = cut.close;
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
    return run(arguments);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : kBadInput;
  } catch (const std::exception& error) {
    // It may repeat what a file says.
    std::cerr << "isomesh-verify: " << printable_lines(error.what()) << '\n';
    return kBadInput;
  }
}
