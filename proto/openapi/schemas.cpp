#include "proto/openapi/schemas.h"

#include <vector>

#include "proto/notes.h"
#include "proto/openapi/yaml.h"
#include "proto/stages.h"
#include "proto/volume_formats.h"

namespace isomesh {

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
