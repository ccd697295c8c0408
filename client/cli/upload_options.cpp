#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "base/text.h"
#include "client/cli/ids.h"
#include "client/cli/option_groups.h"
#include "client/cli/option_values.h"
#include "proto/volume_formats.h"

namespace isomesh::cli {

void add_file(CLI::App& app, Options& options, Inputs inputs) {
  const bool takes_ids = inputs == Inputs::kFilesAndVolumes;
  app.add_option_function<std::vector<std::string>>(
         "FILE",
         [&options, takes_ids](const std::vector<std::string>& paths) {
           for (const std::string& path : paths) {
             std::error_code error;
             const bool is_there = path == "-" || std::filesystem::exists(path, error);
             if (!is_there && !(takes_ids && may_be_volume_id(path))) {
               refuse("FILE", path + (error ? ": " + error.message() : " does not exist"));
             }
             if (path == "-" && std::ranges::count(paths, "-") > 1) {
               refuse("FILE", "standard input (-) can only be given once");
             }
             options.files.emplace_back(path);
           }
         },
         std::string("A volume: " + volume_format_titles() +
                     ", a folder or archive of it, or raw samples with --dims and --type. Several "
                     "files may belong together, such as .hdr and .img. - reads standard input") +
             (takes_ids ? ". The id of a stored volume also works; its beginning or end is enough "
                          "if unique"
                        : ""))
      ->type_name("FILE")
      ->required();
  add(app, "--series", "UID", "UID of the DICOM series to use, if there are several",
      [&](const std::string& text) { options.upload.series = text; })
      ->group(kUploadGroup);
  add(app, "--member", "NAME", "The archive's member to use, if it holds several volumes",
      [&](const std::string& text) { options.upload.member = text; })
      ->group(kUploadGroup);
  app.add_flag(
         "--masks", options.upload.masks,
         "The files or folder are masks, each of one structure: make one volume of them, with "
         "a label for each, named after its file. Without --labels, all are meshed")
      ->group(kUploadGroup);
  add_number<std::uint32_t>(app, "--volume",
                            "Index of the volume to use, from 0, if the file holds several",
                            [&](std::uint32_t number) { options.upload.volume = number; })
      ->group(kUploadGroup);
  add(app, "--accept", "CODE,..",
      "Accept the volume despite these notes; the error names their codes",
      [&](const std::string& text) {
        for (const std::string_view code : split(text, ','))
          options.upload.accept.emplace_back(code);
      })
      ->group(kUploadGroup);
  add_name<NiftiForm>(app, "--nifti-form",
                      "Use the sform or the qform of a NIfTI header for the geometry",
                      [&](NiftiForm form) { options.upload.nifti_form = form; })
      ->group(kUploadGroup);
  add_name<SaidModality>(
      app, "--modality",
      "The file does not say so, but it is a CT in Hounsfield units: gives it presets for --iso",
      [&](SaidModality modality) { options.upload.modality = modality; })
      ->group(kUploadGroup);
  add(app, "--name", "TEXT", "Name of the volume (default: the name of the series or the file)",
      [&](const std::string& text) { options.upload.name = text; })
      ->group(kUploadGroup);
  app.add_flag("--digest", options.upload.digest,
               "Send the file's SHA-256, so that the server can check what it received")
      ->group(kUploadGroup);
}

void add_raw(CLI::App& app, Options& options) {
  const auto raw = [&options]() -> RawDescription& {
    auto& described = options.upload.raw;
    return described ? *described : described.emplace();
  };
  auto* dims = add(
      app, "--dims", "X,Y,Z", "Number of samples along x, y and z; x varies fastest",
      [raw](const std::string& text) {
        const auto sizes = all_numbers_from<std::uint32_t, 3>(text);
        if (!sizes || std::ranges::count(*sizes, 0U) > 0) {
          refuse("--dims", "must be three whole numbers from 1 to 4294967295, separated by commas");
        }
        raw().dims = *sizes;
      });
  auto* type = add_name<SampleType>(app, "--type", "Type of the samples",
                                    [raw](SampleType value) { raw().type = value; });
  dims->needs(type);
  type->needs(dims);
  auto* spacing = add(
      app, "--spacing", "X,Y,Z",
      "Distance between samples along each axis, in millimetres: of raw samples, or of a file that "
      "gives none",
      [&options](const std::string& text) {
        options.upload.spacing = numbers_from<double, 3>("--spacing", text);
        const auto is_length = [](double length) { return length > 0 && std::isfinite(length); };
        if (!std::ranges::all_of(*options.upload.spacing, is_length)) {
          refuse("--spacing", "must be three numbers above 0, separated by commas");
        }
      });
  spacing->group(kRawGroup);
  std::vector<CLI::Option*> others = {
      add(app, "--origin", "X,Y,Z", "Position of the first sample, in millimetres (LPS)",
          [raw](const std::string& text) {
            raw().geometry.origin = numbers_from<double, 3>("--origin", text);
          }),
      add(app, "--direction", "A,..,I",
          "Directions of the axes: a 3 x 3 matrix, row by row; its columns are the axes",
          [raw](const std::string& text) {
            raw().geometry.direction = numbers_from<double, 9>("--direction", text);
          }),
      add(app, "--byte-order", "little|big", "Order of the bytes of a sample (default: little)",
          [raw](const std::string& text) {
            if (text != "little" && text != "big") refuse("--byte-order", "must be little or big");
            raw().big_endian = text == "big";
          })};
  for (CLI::Option* other : others) other->needs(dims)->group(kRawGroup);
  dims->group(kRawGroup);
  type->group(kRawGroup);
}

}  // namespace isomesh::cli
