#include "proto/openapi/schemas.h"

#include <vector>

#include "proto/notes.h"
#include "proto/openapi/yaml.h"
#include "proto/stages.h"
#include "proto/types.h"
#include "proto/volume_formats.h"

namespace isomesh {
namespace {

// "`glb`, `3mf` and `usdz`": the formats that are in no ZIP of labels, beside that itself.
std::string unzipped_formats() {
  std::string text;
  std::string last;
  for (const FormatRow& row : kFormatRows) {
    if (row.is_zipped || row.format == MeshFormat::kZip) continue;
    if (!last.empty()) text += (text.empty() ? "" : ", ") + last;
    last = '`' + std::string(row.name) + '`';
  }
  return text + " and " + last;
}

}  // namespace

std::string schemas_of_notes() {
  std::vector<std::string> all;
  std::vector<std::string> acceptable;
  for (const NoteDescription& note : note_descriptions()) {
    all.emplace_back(note.name);
    if (note.is_acceptable) acceptable.emplace_back(note.name);
  }
  Yaml yaml(2);
  yaml.under("NoteCode", [&] {
    yaml.line("description: |");
    yaml.line("  A stable name, for programs.");
    for (const NoteDescription& note : note_descriptions()) {
      yaml.line("  * `" + std::string(note.name) + "`: " + std::string(note.meaning));
    }
    yaml.line("type: string");
    yaml.under("enum", [&] {
      for (const std::string& name : all) yaml.line("- " + name);
    });
  });
  yaml.under("AcceptableNote", [&] {
    yaml.line("description: A reason to reject a volume, unless the query accepts it.");
    yaml.line("type: string");
    yaml.line("enum: " + in_brackets(acceptable));
  });
  return yaml.str();
}

std::string schema_of_volume_formats() {
  std::vector<std::string> names;
  for (const VolumeFormat& format : volume_formats()) names.emplace_back(format.name);
  Yaml yaml(2);
  yaml.under("VolumeFormat", [&] {
    yaml.line("description: |");
    yaml.line("  The format of an upload.");
    for (const VolumeFormat& format : volume_formats()) {
      yaml.line("  * `" + std::string(format.name) + "`: " + std::string(format.title) + " (`" +
                std::string(format.suffixes) + "`)");
    }
    yaml.line("type: string");
    yaml.under("enum", [&] {
      for (const std::string& name : names) yaml.line("- " + name);
    });
    yaml.under("x-titles", [&] {
      for (const VolumeFormat& format : volume_formats()) {
        yaml.line(std::string(format.name) + ": " + std::string(format.title));
      }
    });
    yaml.under("x-suffixes", [&] {
      for (const VolumeFormat& format : volume_formats()) {
        yaml.line(std::string(format.name) + ": '" + std::string(format.suffixes) + "'");
      }
    });
  });
  return yaml.str();
}

std::string schema_of_mesh_formats() {
  Yaml yaml(2);
  yaml.under("MeshFormat", [&] {
    yaml.text(
        "description",
        "The format and suffix of a mesh file. STL, PLY and VTK are binary. `vtk` is VTK's legacy "
        "format, `vtp` its XML format, `gii` GIFTI, `usda` USD's text, and `usdz` that text in a "
        "package. `zip` is for labels. It holds one file per label in each other requested format "
        "except " +
            unzipped_formats() + ". If there is none, the files are STL.");
    yaml.line("type: string");
    yaml.line("enum: " + in_brackets(name_list<MeshFormat>()));
    std::vector<std::string> whole;
    for (const MeshFormat format : values_of<MeshFormat>()) {
      if (holds_all_labels(format)) whole.emplace_back(to_string(format));
    }
    yaml.line("x-hold-all-labels: " + in_brackets(whole));
    yaml.under("x-titles", [&] {
      for (const FormatRow& row : kFormatRows) {
        yaml.line("'" + std::string(row.name) + "': " + std::string(row.title));
      }
    });
    yaml.under("x-file-suffixes", [&] {
      for (const FormatRow& row : kFormatRows) {
        if (row.file_suffix.empty()) continue;
        yaml.line("'" + std::string(row.name) + "': " + std::string(row.file_suffix));
      }
    });
  });
  return yaml.str();
}

std::string schemas_of_stages() {
  std::vector<std::string> names;
  std::vector<std::string> timed;
  for (const StageRow& row : kStages) {
    names.emplace_back(row.name);
    if (row.elapsed != nullptr) timed.emplace_back(row.name);
  }
  timed.emplace_back("total");
  Yaml yaml(2);
  const auto milliseconds = [&](const std::string& name, const std::string& help) {
    yaml.line(name + ": { type: number, minimum: 0, description: '" + help + "' }");
  };
  yaml.under("Stage", [&] {
    yaml.line("description: The current stage of a job, or its last one.");
    yaml.line("type: string");
    yaml.line("enum: " + in_brackets(names));
  });
  yaml.under("Timing", [&] {
    yaml.line("description: The milliseconds of each stage. 0 for a stage that has not ended.");
    yaml.line("type: object");
    yaml.line("additionalProperties: false");
    yaml.line("required: " + in_brackets(timed));
    yaml.under("properties", [&] {
      for (const StageRow& row : kStages) {
        if (row.elapsed != nullptr) milliseconds(row.name, row.help);
      }
      milliseconds("total", "From acceptance to end.");
    });
  });
  return yaml.str();
}

}  // namespace isomesh
